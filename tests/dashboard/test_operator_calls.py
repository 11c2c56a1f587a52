"""Reset, switches and release from the browser: what was seen, how old it is, what it changed."""

import time
from collections.abc import Iterator

import pytest

from common.messages import Cause
from tests.dashboard.bus_fixture import World
from tests.dashboard.servers import CONTACT, NEWER, Servers, serving
from verification.harness.dashboard import Eye, Site, eye
from verification.harness.support import wait_until

PROXY_S = 5.0  # that a proxy delays a message


@pytest.fixture
def servers(endpoint: str, world: World) -> Iterator[Servers]:
    with serving(endpoint, world) as it:
        yield it


@pytest.fixture
def ada(site: Site, servers: Servers) -> Iterator[Eye]:
    """The driver's connection, at a contact."""
    with eye(site) as it:
        it.takes()
        seen(it, CONTACT)
        yield it


def seen(it: Eye, cause: Cause) -> int:
    """Wait for a picture with a cause, and return its number."""
    while True:
        picture = it.look()
        if picture["safety"] and [one["id"] for one in picture["safety"]["causes"]] == [cause.id]:
            return int(picture["n"])


def told(it: Eye) -> tuple[str, str]:
    word = it.waits("notice")
    return word["level"], word["text"]


def test_a_reset_names_what_was_seen_and_is_confirmed(ada: Eye, servers: Servers) -> None:
    ada.say("reset", n=seen(ada, CONTACT))
    assert told(ada) == ("info", "Reset.")
    (request,) = servers.resets
    assert request.causes == (CONTACT.id,)
    assert request.echo is not None
    assert 0 <= time.monotonic_ns() - request.echo < 20e9  # a heartbeat of this world


def test_a_reset_does_not_name_a_newer_contact(ada: Eye, servers: Servers) -> None:
    servers.is_effective = False
    number = seen(ada, CONTACT)
    servers.world.causes = (NEWER,)
    seen(ada, NEWER)
    ada.say("reset", n=number)
    wait_until(lambda: servers.resets, "the reset")
    assert servers.resets[0].causes == (CONTACT.id,)


def test_a_reset_that_a_proxy_held_clears_nothing(ada: Eye, servers: Servers) -> None:
    number, began = seen(ada, CONTACT), time.monotonic()
    servers.world.causes = (NEWER,)
    while time.monotonic() - began < PROXY_S:
        ada.look()
    ada.say("reset", n=number)
    assert told(ada) == ("warning", "too_late")
    ada.say("switch", n=number, to={"bumper_brake": False})
    assert told(ada) == ("warning", "too_late")
    ada.say("reset")
    assert told(ada) == ("warning", "too_late")
    assert servers.resets == []
    assert servers.switches == []
    assert servers.world.causes == (NEWER,)


def test_an_answer_that_is_not_safetys_is_not_confirmed(ada: Eye, servers: Servers) -> None:
    servers.boot += 1
    servers.is_effective = False
    ada.say("reset", n=seen(ada, CONTACT))
    assert told(ada) == ("error", "reset_unconfirmed")


def test_a_reset_without_effect_is_not_confirmed(ada: Eye, servers: Servers) -> None:
    servers.is_effective = False
    began = time.monotonic()
    ada.say("reset", n=seen(ada, CONTACT))
    assert told(ada) == ("error", "reset_unconfirmed")
    assert time.monotonic() - began > 0.9


def test_a_switch_carries_the_echo_of_what_was_seen(ada: Eye, servers: Servers) -> None:
    ada.say("switch", n=seen(ada, CONTACT), to={"bumper_brake": False, "echo": 1})
    assert told(ada) == ("info", "done")
    (request,) = servers.switches
    assert request.bumper_brake is False
    assert (request.echo or 0) > 1


def test_a_release_names_the_direction_and_what_was_seen(ada: Eye, servers: Servers) -> None:
    for _ in range(20):
        ada.say("hold", n=ada.look()["n"], release="backward")
    assert ada.seen["fast"]["safety"]["release"]["believed_free"] == "backward"
    ada.say("free")
    wait_until(lambda: servers.releases and not servers.releases[-1].held, "the end of it")
    held, end = servers.releases[:-1], servers.releases[-1]
    assert {one.direction for one in held} == {"backward"}
    echoes = [one.echo or 0 for one in held]
    assert echoes == sorted(echoes)
    assert len(set(echoes)) > 2
    assert end.direction is None


def test_a_release_that_comes_late_is_not_asked(ada: Eye, servers: Servers) -> None:
    number, began = seen(ada, CONTACT), time.monotonic()
    while time.monotonic() - began < 1.0:
        ada.look()
    for _ in range(20):
        ada.say("hold", n=number, release="backward")
        ada.look()
    assert servers.releases == []
