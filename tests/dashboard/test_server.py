"""The whole program without a browser: a real bus, real sockets, real requests."""

import signal
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from common.freshness import NS_PER_S
from services.dashboard.fleet import ROBOTS_MAX
from tests.dashboard.bus_fixture import HOLD, World, drive
from verification.harness.dashboard import Eye, Site, dashboard, eye
from verification.harness.support import wait_until


@pytest.fixture
def ada(site: Site, world: World) -> Iterator[Eye]:
    """A viewer who sees that safety runs."""
    world.safe = True
    with eye(site) as it:
        while not it.look()["safety"]:
            pass
        yield it


def test_a_hold_drives_and_letting_go_is_zeros_and_silence(ada: Eye, world: World) -> None:
    ada.takes()
    world.requests.clear()
    drive(ada, world)
    assert world.requests[0].linear == 0.0  # neutral first
    assert world.requests[-1].linear == 0.2  # the first gear
    assert world.requests[-1].echo > 0
    ada.say("free")
    wait_until(lambda: world.zeros() >= 3, "zeros")
    ada.look()
    ada.look()
    assert world.zeros() == 3


def test_a_missed_round_trip_lets_go_until_the_hand_was_off(ada: Eye, world: World) -> None:
    ada.takes()
    world.requests.clear()
    drive(ada, world)
    silent_ns = time.monotonic_ns()  # the socket stays open, and nothing is answered
    wait_until(lambda: world.zeros() >= 3, "zeros")
    assert time.monotonic_ns() - silent_ns > 0.1 * NS_PER_S
    while ada.look()["driver"]["hold"] != "lapsed":
        pass  # pictures from before, which nobody has read yet
    count = len(world.requests)
    for _ in range(10):
        picture = ada.look()
        ada.say("hold", n=picture["n"], **HOLD)
        assert picture["driver"]["hold"] == "lapsed"
    assert len(world.requests) == count
    ada.say("free")
    drive(ada, world)


def test_an_old_picture_is_no_reason_to_drive(ada: Eye, world: World) -> None:
    ada.takes()
    ada.say("free")
    first = ada.look()["n"]
    for _ in range(12):
        ada.look()
    world.requests.clear()
    ada.say("hold", n=first, **HOLD)
    for _ in range(4):
        assert ada.look()["driver"]["hold"] == "free"
    assert world.requests == []


def test_a_viewer_who_is_gone_has_let_go(site: Site, world: World) -> None:
    with eye(site) as it:
        it.takes()
        world.requests.clear()
        drive(it, world)
    wait_until(lambda: world.zeros() >= 3, "zeros")
    with eye(site) as it:
        assert it.look()["driver"]["id"] is None


def test_a_silent_safety_lets_go(ada: Eye, world: World) -> None:
    ada.takes()
    world.requests.clear()
    drive(ada, world)
    world.safe = False
    while (picture := ada.look())["driver"]["hold"] != "lapsed":
        ada.say("hold", n=picture["n"], **HOLD)
    assert picture["safety"] is None
    wait_until(lambda: world.zeros() >= 3, "zeros")


def test_one_drives_and_taking_over_asks(site: Site, ada: Eye, world: World) -> None:
    ada.takes()
    ada.say("look", robot="001", name="Ada")
    with eye(site) as bob:
        bob.say("take")
        assert bob.waits("taken")["by"] == "Ada"
        picture = bob.look()
        assert picture["driver"]["name"] == "Ada"
        world.requests.clear()
        bob.say("hold", n=picture["n"], **HOLD)
        bob.say("reset")
        assert bob.waits("notice")["text"] == "take_first"
        assert world.requests == []
        bob.takes(force=True)
        assert ada.waits("notice")["text"] == "taken_over"


def test_anybody_may_stop_and_it_is_asked_until_it_is_confirmed(ada: Eye, world: World) -> None:
    world.estops.clear()
    ada.say("estop")
    wait_until(lambda: len(world.estops) > 5, "stops, again and again")


def test_one_tap_gets_through_without_a_socket(site: Site, world: World) -> None:
    world.estops.clear()
    taps(site, "001")
    wait_until(lambda: world.estops, "a stop")


def taps(site: Site, robot: str) -> None:
    """Stop a robot beside the socket."""
    request = urllib.request.Request(
        f"{site.url}estop/{robot}", method="POST", headers={"Origin": site.url.rstrip("/")}
    )
    with urllib.request.urlopen(request) as answer:
        assert answer.status == 200


def test_a_refusal_is_told(ada: Eye) -> None:
    ada.takes()
    ada.say("reset", n=ada.look()["n"])
    assert "safety does not answer" in ada.waits("notice")["text"]


def test_several_robots(site: Site, ada: Eye) -> None:
    wait_until(lambda: "002" in ada.waits("slow")["robots"], "the other robot")
    assert "two words" not in ada.seen["slow"]["robots"]
    with eye(site, "002") as it:
        assert it.look()["safety"] is None
        assert [one["name"] for one in it.waits("slow")["services"]] == ["bridge"]
    ada.say("look", robot="003")
    assert ada.waits("hello")["robot"] == "003"


def test_not_any_number_of_robots_but_for_a_stop(site: Site, world: World) -> None:
    with eye(site) as it:
        for number in range(ROBOTS_MAX + 1):
            it.say("look", robot=f"many-{number}")
        assert it.waits("notice")["text"] == "too_many_robots"
    world.stops_elsewhere.clear()
    taps(site, "one-more")
    wait_until(lambda: world.stops_elsewhere, "a stop of one more")


def test_no_robot_is_called_so(site: Site) -> None:
    request = urllib.request.Request(
        f"{site.url}estop/*", method="POST", headers={"Origin": site.url.rstrip("/")}
    )
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(request)


def test_a_stop_of_a_robot_that_is_not_known_is_refused(site: Site, ada: Eye) -> None:
    request = urllib.request.Request(
        f"{site.url}estop/made-up", method="POST", headers={"Origin": site.url.rstrip("/")}
    )
    with pytest.raises(urllib.error.HTTPError, match="404") as refused:
        urllib.request.urlopen(request)
    assert b"robot 'made-up' is unknown" in refused.value.read()
    ada.say("estop", robot="made-up")
    assert ada.waits("notice")["text"] == "estop_unknown"
    assert "made-up" not in ada.waits("slow")["robots"]


@pytest.mark.parametrize("text", ["", "{}", '{"k":"hold"}', "x" * 5000, '{"x":' + "[" * 2000])
def test_who_says_something_else_is_hung_up_on(site: Site, text: str) -> None:
    with eye(site) as it:
        it.socket.send(text)
        with pytest.raises(ConnectionClosed):
            it.waits("never")


def test_it_is_alive_on_the_bus(world: World) -> None:
    wait_until(lambda: world.alive, "presence")


def test_a_signal_is_zeros_and_the_end(endpoint: str, world: World, tmp_path: Path) -> None:
    world.safe = True
    with dashboard(endpoint, tmp_path, "dashboard.round_trip=1.0") as site:
        with eye(site) as it:
            it.takes()
            world.requests.clear()
            drive(it, world)
            site.process.send_signal(signal.SIGTERM)
            wait_until(lambda: world.zeros() >= 3, "zeros")
        wait_until(lambda: site.process.poll() is not None, "its end")
        assert site.process.returncode == 0
        assert "Traceback" not in site.log.read_text()
