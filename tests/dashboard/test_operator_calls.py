"""Reset, switches and release from the browser: the answered snapshot, and the effect."""

from collections.abc import Iterator

import pytest

from common.messages import Cause
from tests.dashboard.bus_fixture import echo_of
from tests.dashboard.servers import CONTACT, NEWER, CallServers
from verification.harness.dashboard import Client, Server, connected
from verification.harness.waiting import wait_until


@pytest.fixture
def ada(server: Server, calls: CallServers) -> Iterator[Client]:
    """The driver's connection, at a contact."""
    with connected(server) as it:
        it.take_control()
        seen(it, CONTACT)
        yield it


def seen(it: Client, cause: Cause) -> int:
    """Wait for a snapshot with a cause and return its heartbeat."""
    while True:
        snapshot = it.next_snapshot()
        if snapshot["safety"] and [one["id"] for one in snapshot["safety"]["causes"]] == [cause.id]:
            return echo_of(snapshot)


def notice(it: Client) -> tuple[str, str]:
    message = it.wait_for("notice")
    return message["level"], message["text"]


def test_a_reset_names_what_was_seen_and_is_confirmed(ada: Client, calls: CallServers) -> None:
    ada.send("reset", echo=(echo := seen(ada, CONTACT)))
    assert notice(ada) == ("info", "Reset.")
    (request,) = calls.resets
    assert request.causes == (CONTACT.id,)
    assert request.echo == echo


def test_a_reset_does_not_name_a_newer_contact(ada: Client, calls: CallServers) -> None:
    calls.is_effective = False
    echo = seen(ada, CONTACT)
    calls.peer.causes = (NEWER,)
    seen(ada, NEWER)
    ada.send("reset", echo=echo)
    wait_until(lambda: calls.resets, "the reset")
    assert calls.resets[0].causes == (CONTACT.id,)


def test_an_answer_that_is_not_safetys_is_not_confirmed(ada: Client, calls: CallServers) -> None:
    calls.boot += 1
    calls.is_effective = False
    ada.send("reset", echo=seen(ada, CONTACT))
    assert notice(ada) == ("error", "reset_unconfirmed")


def test_a_switch_carries_the_echo_of_what_was_seen(ada: Client, calls: CallServers) -> None:
    echo = seen(ada, CONTACT)
    ada.send("switch", to={"bumper_brake": False, "echo": echo})
    assert notice(ada) == ("info", "done")
    (request,) = calls.switches
    assert (request.bumper_brake, request.echo) == (False, echo)


def test_a_release_is_requested_while_held(ada: Client, calls: CallServers) -> None:
    for _ in range(20):
        ada.send("hold", echo=echo_of(ada.next_snapshot()), release="backward")
    safety = ada.received["fast"]["safety"]
    assert (safety["release"]["believed_free"], safety["release_refusal"]) == ("backward", "")
    assert calls.releases() == {"backward"}
    ada.send("free")
    wait_until(lambda: calls.peer.requests[-1].release == "none", "the end of it")
