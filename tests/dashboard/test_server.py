"""The whole program without a browser: a real bus, real sockets, real requests."""

import json
import signal
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from common import keys
from common.bus.bus import Bus
from common.freshness import S
from common.loop import Loop
from common.messages import Drive
from services.dashboard.fleet import ROBOTS_MAX
from services.dashboard.server import reachable
from tests.dashboard.rig import Eye, Site, dashboard, eye
from tests.support import PATIENCE_S, bus_on, free_port, router_process, running, wait_until
from tests.teleop.support import safety_state

HOLD = {"x": 1.0, "y": 0.0}


class World:
    """What else is on the bus: a safety that runs, and ears for what is asked."""

    def __init__(self, loop: Loop) -> None:
        self.requests: list[Drive] = []
        self.estops: list[int] = []
        self.stops_elsewhere: list[int] = []
        self.alive: list[str] = []
        self.safe = True
        self.latched: tuple[str, ...] = ()
        self._loop = loop

    def declare(self, bus: Bus) -> None:
        state = bus.publisher(keys.SAFETY)
        bus.subscribe(
            keys.DRIVE, lambda it: self.requests.append(it.message), source="web", depth=64
        )
        bus.on_any(keys.estop_key("001"), self.estops.append)
        bus.on_any(keys.estop_key("one-more"), self.stops_elsewhere.append)
        bus.watch_live(
            keys.live_key("001", "dashboard", "*"), lambda key, _: self.alive.append(key)
        )
        bus.live(keys.live_key("two words", "bridge", "x"))
        bus.live(keys.live_key("002", "bridge", "x"))

        def tell(now_ns: int) -> None:
            if self.safe:
                state.put(safety_state(heartbeat=now_ns, latched=self.latched))

        self._loop.post(lambda: self._loop.every(0.05, tell))

    def quiet(self) -> None:
        """Wait until no stop has come for a second."""
        count, since_ns = len(self.estops), time.monotonic_ns()

        def over() -> bool:
            nonlocal count, since_ns
            if len(self.estops) != count:
                count, since_ns = len(self.estops), time.monotonic_ns()
            return time.monotonic_ns() - since_ns > S

        wait_until(over, "no more stops")

    def moving(self) -> bool:
        return bool(self.requests) and self.requests[-1].linear > 0

    def zeros(self) -> int:
        """Return how many zeros came last."""
        count = 0
        while count < len(self.requests) and not self.requests[-1 - count].linear:
            count += 1
        return count


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where):
        yield where


@pytest.fixture(scope="module")
def world(endpoint: str) -> Iterator[World]:
    with running(Loop()) as loop:
        world = World(loop)
        with bus_on(endpoint, loop, world.declare):
            yield world


@pytest.fixture(scope="module")
def site(endpoint: str, world: World, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with dashboard(endpoint, tmp_path_factory.mktemp("site"), "dashboard.round_trip=0.5") as it:
        yield it


@pytest.fixture
def ada(site: Site, world: World) -> Iterator[Eye]:
    """A viewer who sees that safety runs."""
    world.safe = True
    with eye(site) as it:
        while not it.look()["safety"]:
            pass
        yield it


def drive(it: Eye, world: World) -> None:
    """Answer every picture with a push, until requests to move go out."""
    deadline = time.monotonic() + PATIENCE_S
    while not world.moving():
        assert time.monotonic() < deadline, "nothing was ever asked"
        picture = it.look()
        if picture["hands"]["grip"] == "lapsed":
            it.say("free")  # this machine held somebody up
        else:
            it.say("hold", n=picture["n"], **HOLD)


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
    assert time.monotonic_ns() - silent_ns > 0.1 * S
    while ada.look()["hands"]["grip"] != "lapsed":
        pass  # pictures from before, which nobody has read yet
    count = len(world.requests)
    for _ in range(10):
        picture = ada.look()
        ada.say("hold", n=picture["n"], **HOLD)
        assert picture["hands"]["grip"] == "lapsed"
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
        assert ada.look()["hands"]["grip"] == "free"
    assert world.requests == []


def test_a_viewer_who_is_gone_has_let_go(site: Site, world: World) -> None:
    with eye(site) as it:
        it.takes()
        world.requests.clear()
        drive(it, world)
    wait_until(lambda: world.zeros() >= 3, "zeros")
    with eye(site) as it:
        assert it.look()["hands"]["id"] is None


def test_a_silent_safety_lets_go(ada: Eye, world: World) -> None:
    ada.takes()
    world.requests.clear()
    drive(ada, world)
    world.safe = False
    while (picture := ada.look())["hands"]["grip"] != "lapsed":
        ada.say("hold", n=picture["n"], **HOLD)
    assert picture["safety"] is None
    wait_until(lambda: world.zeros() >= 3, "zeros")


def test_one_drives_and_taking_over_asks(site: Site, ada: Eye, world: World) -> None:
    ada.takes()
    ada.say("look", robot="001", name="Ada")
    with eye(site) as bob:
        bob.say("take")
        assert bob.waits("ask")["who"] == "Ada"
        picture = bob.look()
        assert picture["hands"]["name"] == "Ada"
        world.requests.clear()
        bob.say("hold", n=picture["n"], **HOLD)
        bob.say("reset")
        assert bob.waits("told")["text"] == "take_first"
        assert world.requests == []
        bob.takes(force=True)
        assert ada.waits("told")["text"] == "taken_over"


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
    ada.say("reset")
    assert "safety does not answer" in ada.waits("told")["text"]


def test_several_robots(site: Site, ada: Eye) -> None:
    wait_until(lambda: "002" in ada.waits("rest")["robots"], "the other robot")
    assert "two words" not in ada.seen["rest"]["robots"]
    with eye(site, "002") as it:
        assert it.look()["safety"] is None
        assert [one["name"] for one in it.waits("rest")["services"]] == ["bridge"]
    ada.say("look", robot="003")
    assert ada.waits("hello")["robot"] == "003"


def test_not_any_number_of_robots_but_for_a_stop(site: Site, world: World) -> None:
    with eye(site) as it:
        for number in range(ROBOTS_MAX + 1):
            it.say("look", robot=f"many-{number}")
        assert it.waits("told")["text"] == "too_many_robots"
    world.stops_elsewhere.clear()
    taps(site, "one-more")
    wait_until(lambda: world.stops_elsewhere, "a stop of one more")


def test_no_robot_is_called_so(site: Site) -> None:
    request = urllib.request.Request(
        f"{site.url}estop/*", method="POST", headers={"Origin": site.url.rstrip("/")}
    )
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(request)


@pytest.mark.parametrize("text", ["", "{}", '{"k":"hold"}', "x" * 5000, '{"x":' + "[" * 2000])
def test_who_says_something_else_is_hung_up_on(site: Site, text: str) -> None:
    with eye(site) as it:
        it.socket.send(text)
        with pytest.raises(ConnectionClosed):
            it.waits("never")


def test_it_is_alive_on_the_bus(world: World) -> None:
    wait_until(lambda: world.alive, "presence")


# --- the door ---------------------------------------------------------------------------------


def test_another_page_of_the_same_browser_cannot_act(site: Site, world: World) -> None:
    for origin in (Origin("http://evil.example"), None):
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{site.port}/live", origin=origin)
    world.latched = ("estop",)  # so that earlier stops are repeated no more
    world.quiet()
    world.estops.clear()
    request = urllib.request.Request(f"{site.url}estop/001", method="POST")
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(request)
    assert world.estops == []
    world.latched = ()


def test_a_bent_name_is_shown_the_right_one(site: Site) -> None:
    request = urllib.request.Request(site.url, headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError, match="403") as refused:
        urllib.request.urlopen(request)
    assert b"localhost" in refused.value.read()


def browser() -> urllib.request.OpenerDirector:
    """Return something that keeps cookies."""
    return urllib.request.build_opener(urllib.request.HTTPCookieProcessor())


def test_on_the_network_a_token_is_asked_for(endpoint: str, tmp_path: Path) -> None:
    secret = tmp_path / "token"
    secret.write_text("open sesame\n", encoding="utf-8")
    sets = ("dashboard.host=0.0.0.0", f"dashboard.token_file={secret}")
    with dashboard(endpoint, tmp_path, *sets) as site:
        for path in ("", "t2/dashboard.js", "?token=wrong"):
            with pytest.raises(urllib.error.HTTPError, match="401") as refused:
                browser().open(site.url + path)
            assert b"<form" in refused.value.read()
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{site.port}/live", origin=Origin(site.url.rstrip("/")))
        one = browser()
        form = urllib.parse.urlencode({"token": "open sesame"}).encode()
        with one.open(site.url, form) as answer:
            assert b'id="texts"' in answer.read()
        with one.open(f"{site.url}t2/dashboard.js") as answer:
            assert answer.status == 200
        with browser().open(f"{site.url}?token=open+sesame") as answer:
            assert answer.status == 200
        assert "open sesame" not in site.log.read_text()


def test_the_address_that_is_named() -> None:
    assert reachable("127.0.0.1") == "127.0.0.1"
    assert reachable("fe80::1") == "[fe80::1]"
    for everywhere in ("0.0.0.0", "::"):
        assert reachable(everywhere).strip("[]") not in ("", everywhere)


def test_a_new_token_is_printed(endpoint: str, tmp_path: Path) -> None:
    with dashboard(endpoint, tmp_path, "dashboard.host=0.0.0.0") as site:
        lines = [json.loads(line) for line in site.log.read_text().splitlines()]
        where = next(line["open"] for line in lines if line["event"] == "started")
        assert "0.0.0.0" not in where
        with browser().open(f"{site.url}?{urlsplit(where).query}") as answer:
            assert b'id="texts"' in answer.read()


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
