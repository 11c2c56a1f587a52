"""Both ends of the drive link in one process, beside a real router."""

import socket
import time
from pathlib import Path

import pytest

from common.bus.bus import Arrival, Bus
from common.bus.drive import DriveLink, LinkWatch
from common.freshness import NS_PER_S
from common.settings import BusSettings as Settings
from t2 import keys
from t2.messages import Bumper, Command, Motion
from tests.common.bus_fixture import BusFixture, rising, until_received
from verification.harness.bus import Lines, at
from verification.harness.waiting import wait_until


class Ends:
    """A bridge's and a safety's link, and what came."""

    def __init__(self, buses: BusFixture) -> None:
        self.buses = buses
        self.motions: list[Arrival[Motion]] = []
        self.bumpers: list[Arrival[Bumper]] = []
        self.bridge = self.bridge_end()
        self.safety = self.safety_end()
        self.linked()

    def bridge_end(self) -> DriveLink:
        bus = Bus(at(self.buses.endpoint), self.buses.robot, self.buses.loop.post)
        link = DriveLink(bus, listens=True)
        link.subscribe(keys.MOTION, self.motions.append, depth=100)
        self.bumper = link.publisher(keys.BUMPER)
        self.bridges_bus = self.buses.opened(bus)
        return link

    def safety_end(self) -> DriveLink:
        bus = Bus(at(self.buses.endpoint), self.buses.robot, self.buses.loop.post)
        link = DriveLink(bus, listens=False)
        link.subscribe(keys.BUMPER, self.bumpers.append, depth=100)
        self.motion = link.publisher(keys.MOTION)
        self.safetys_bus = self.buses.opened(bus)
        return link

    def linked(self) -> None:
        wait_until(lambda: self.bridge.connected and self.safety.connected, "the link")
        until_received(
            lambda: (self.motion.put(Motion(command=Command.STOP)), self.bumper.put(CLEAR)),
            lambda: self.motions and self.bumpers,
            "both ways",
        )


CLEAR = Bumper(pressed=False)


@pytest.fixture
def ends(buses: BusFixture) -> Ends:
    return Ends(buses)


def test_each_message_arrives_once_and_once_for_observers_on_the_bus(ends: Ends) -> None:
    seen: list[Arrival[Bumper]] = []
    ends.buses.bus(lambda bus: bus.subscribe(keys.BUMPER, seen.append, depth=100))
    until_received(lambda: ends.bumper.put(CLEAR), lambda: seen, "a bumper")
    ends.bumpers.clear()
    first = ends.bumper._seq + 1
    for _ in range(50):
        ends.bumper.put(CLEAR, b"raw")
        time.sleep(0.002)
    for arrivals in (ends.bumpers, seen):
        wait_until(lambda a=arrivals: a[-1:] and a[-1].message.seq == first + 49, "the last")  # type: ignore[misc]
        assert rising(arrival.message.seq for arrival in arrivals)
    assert ends.bumpers[-1].raw == b"raw"
    key = keys.BUMPER.on(ends.buses.robot)
    assert ends.bridges_bus.counts[key] == ends.bumper._seq  # counted once
    assert ends.safetys_bus.counts[key] >= len(ends.bumpers)
    assert ends.bumpers[-1].message.boot == ends.bridges_bus.boot
    assert ends.bridge.socket == ends.safety.socket
    assert ends.bridge.socket.stat().st_mode & 0o777 == 0o600


def test_it_works_without_a_router_and_from_before_there_is_one(buses: BusFixture) -> None:
    buses.endpoint = "tcp/127.0.0.1:1"

    def opened(bus: Bus) -> Bus:
        bus.open()
        buses._stack.callback(bus.close)
        return bus

    buses.opened = opened  # type: ignore[method-assign]
    ends = Ends(buses)
    assert not ends.bridges_bus.connected
    assert ends.bridge.connected
    assert ends.motion.passed_on


@pytest.mark.parametrize("first", ["bridge", "safety"])
def test_an_end_that_is_back_is_found_at_once(ends: Ends, first: str) -> None:
    gone = ends.bridges_bus if first == "bridge" else ends.safetys_bus
    left = ends.safety if first == "bridge" else ends.bridge
    gone.close()
    wait_until(lambda: not left.connected, "the loss")
    began_s = time.monotonic()
    if first == "bridge":
        ends.bridge = ends.bridge_end()
    else:
        ends.safety = ends.safety_end()
    wait_until(lambda: ends.bridge.connected and ends.safety.connected, "the link")
    assert time.monotonic() - began_s < 2.0
    ends.motions.clear()
    ends.bumpers.clear()
    ends.linked()


def test_a_socket_left_by_a_killed_bridge_is_taken_over(buses: BusFixture, tmp_path: Path) -> None:
    where = Settings(connect=(buses.endpoint,), drive=f"unixsock-stream/{tmp_path}/t2/d.sock")
    bus = Bus(where, buses.robot, buses.loop.post)
    link = DriveLink(bus, listens=True)
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(link.socket))
    buses.opened(bus)
    wait_until(lambda: link._session.zenoh is not None, "it listens")


def test_a_second_bridge_waits_and_says_why(ends: Ends, lines: Lines) -> None:
    second = Bus(at(ends.buses.endpoint), ends.buses.robot, ends.buses.loop.post)
    link = DriveLink(second, listens=True)
    ends.buses.opened(second)
    wait_until(lambda: lines, "a line")
    assert "cannot listen" in lines[0][1]
    assert lines[0][2] == {"socket": str(link.socket)}
    assert not link.connected


class FakeLink:
    other, socket, connected = "safety", Path("/run/t2/d.sock"), False


def test_a_link_that_is_missing_lost_or_back_is_reported(lines: Lines) -> None:
    link, events = FakeLink(), []
    watch = LinkWatch(link, lambda name, level, other: events.append((name, level, other)))  # type: ignore[arg-type]
    for second in range(12):
        watch.check(second * NS_PER_S)
    assert [line[1].split(";")[0] for line in lines] == ["no safety on the drive link"] * 2
    link.connected = True
    watch.check(12 * NS_PER_S)
    assert events == []  # it came for the first time
    link.connected = False
    for second in range(13, 19):
        watch.check(second * NS_PER_S)
    assert len(lines) == 3
    link.connected = True
    watch.check(19 * NS_PER_S)
    assert [event[:2] for event in events] == [
        ("drive_link_lost", "error"), ("drive_link_up", "info"),
    ]  # fmt: skip
    assert events[0][2] == "safety"
