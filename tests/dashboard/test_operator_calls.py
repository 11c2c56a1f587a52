"""Reset, switches and release from the browser: the answered snapshot, its age, the effect."""

import time
from collections.abc import Iterator

import pytest

from common import clock
from common.messages import Cause
from tests.dashboard.servers import CONTACT, NEWER, CallServers
from verification.harness.dashboard import Client, Server, connected
from verification.harness.waiting import wait_until

PROXY_S = 5.0  # that a proxy delays a message


@pytest.fixture
def ada(server: Server, calls: CallServers) -> Iterator[Client]:
    """The driver's connection, at a contact."""
    with connected(server) as it:
        it.take_control()
        seen(it, CONTACT)
        yield it


def seen(it: Client, cause: Cause) -> int:
    """Wait for a snapshot with a cause and return its number."""
    while True:
        snapshot = it.next_snapshot()
        if snapshot["safety"] and [one["id"] for one in snapshot["safety"]["causes"]] == [cause.id]:
            return int(snapshot["n"])


def notice(it: Client) -> tuple[str, str]:
    message = it.wait_for("notice")
    return message["level"], message["text"]


def test_a_reset_names_what_was_seen_and_is_confirmed(ada: Client, calls: CallServers) -> None:
    ada.send("reset", n=seen(ada, CONTACT))
    assert notice(ada) == ("info", "Reset.")
    (request,) = calls.resets
    assert request.causes == (CONTACT.id,)
    assert request.echo is not None
    assert 0 <= clock.now_ns() - request.echo < 20e9  # a heartbeat of this peer


def test_a_reset_does_not_name_a_newer_contact(ada: Client, calls: CallServers) -> None:
    calls.is_effective = False
    number = seen(ada, CONTACT)
    calls.peer.causes = (NEWER,)
    seen(ada, NEWER)
    ada.send("reset", n=number)
    wait_until(lambda: calls.resets, "the reset")
    assert calls.resets[0].causes == (CONTACT.id,)


def test_a_reset_that_a_proxy_held_clears_nothing(ada: Client, calls: CallServers) -> None:
    number, began = seen(ada, CONTACT), time.monotonic()
    calls.peer.causes = (NEWER,)
    while time.monotonic() - began < PROXY_S:
        ada.next_snapshot()
    ada.send("reset", n=number)
    assert notice(ada) == ("warning", "too_late")
    ada.send("switch", n=number, to={"bumper_brake": False})
    assert notice(ada) == ("warning", "too_late")
    ada.send("reset")
    assert notice(ada) == ("warning", "too_late")
    assert calls.resets == []
    assert calls.switches == []
    assert calls.peer.causes == (NEWER,)


def test_an_answer_that_is_not_safetys_is_not_confirmed(ada: Client, calls: CallServers) -> None:
    calls.boot += 1
    calls.is_effective = False
    ada.send("reset", n=seen(ada, CONTACT))
    assert notice(ada) == ("error", "reset_unconfirmed")


def test_a_reset_without_effect_is_not_confirmed(ada: Client, calls: CallServers) -> None:
    calls.is_effective = False
    began = time.monotonic()
    ada.send("reset", n=seen(ada, CONTACT))
    assert notice(ada) == ("error", "reset_unconfirmed")
    assert time.monotonic() - began > 0.9


def test_a_switch_carries_the_echo_of_what_was_seen(ada: Client, calls: CallServers) -> None:
    ada.send("switch", n=seen(ada, CONTACT), to={"bumper_brake": False, "echo": 1})
    assert notice(ada) == ("info", "done")
    (request,) = calls.switches
    assert request.bumper_brake is False
    assert (request.echo or 0) > 1


def test_a_release_is_requested_while_held(ada: Client, calls: CallServers) -> None:
    for _ in range(20):
        ada.send("hold", n=ada.next_snapshot()["n"], release="backward")
    safety = ada.received["fast"]["safety"]
    assert (safety["release"]["believed_free"], safety["release_refusal"]) == ("backward", "")
    assert calls.releases() == {"backward"}
    ada.send("free")
    wait_until(lambda: calls.peer.requests[-1].release == "none", "the end of it")


def test_a_late_release_is_not_requested(ada: Client, calls: CallServers) -> None:
    number, began = seen(ada, CONTACT), time.monotonic()
    while time.monotonic() - began < 1.0:
        ada.next_snapshot()
    for _ in range(20):
        ada.send("hold", n=number, release="backward")
        ada.next_snapshot()
    assert calls.releases() == set()
