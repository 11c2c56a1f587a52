"""The bridge's shell in this process: sockets that refuse or fail, and what it observes."""

import errno
from collections.abc import Iterator

import pytest

from common import clock
from common.bus.bus import Arrival
from common.config import Sources, load
from common.service import Node
from common.wire import framing
from common.wire.commands import MotionCommand, MotionKind
from common.wire.reports import BumperReport
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from t2.messages import Command, Link, Motion
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until

HIT, STOP, BREAK = (
    framing.pack(frame)
    for frame in (
        BumperReport(True),
        MotionCommand(MotionKind.STOP),
        MotionCommand(MotionKind.BREAK),
    )
)


@pytest.fixture
def made() -> Iterator[Board]:
    with board() as made:
        yield made


@pytest.fixture
def bridge(made: Board) -> Iterator[Bridge]:
    sets = [f"board.port={made.address[1]}", f"board.listen_ports={made.ports}"]
    node = Node("bridge", load(BridgeConfig, Sources(environ={}, sets=sets)))
    bridge = Bridge(node)
    yield bridge
    bridge._sockets.close()
    node.loop.close()


def test_a_hit_is_braked_for_and_timed(bridge: Bridge, made: Board) -> None:
    made.say_bytes(HIT)

    def brakes() -> bool:
        bridge._read(0, 1)
        return made.motions[-1:] != [] and made.motions[-1].kind is MotionKind.BREAK

    wait_until(brakes, "BRAKE")
    assert sum(bridge._node.reactions()["reflex"].counts) == 1
    assert events_of(bridge) == [], "they wait for the tick"
    ticks(bridge)
    assert "contact" in events_of(bridge)
    boot = bridge._node.bus.boot
    for seq in (1, 2):
        motion = Motion(command=Command.BRAKE, seq=seq, boot=1, judged=99, judged_boot=boot)
        bridge._on_motion(Arrival(motion, "k", clock.now_ns(), None))
    judged_stop = bridge._node.reactions()["judged_stop"]
    assert sum(judged_stop.counts) == 1
    assert 0 < judged_stop.worst < 10.0


def test_an_event_is_not_lost_at_the_end(bridge: Bridge, made: Board) -> None:
    made.say_bytes(HIT)

    def is_hit() -> bool:
        bridge._read(0, 1)
        return bool(bridge._events)

    wait_until(is_hit, "the hit")
    bridge._on_exit()
    assert "contact" in events_of(bridge)


def events_of(bridge: Bridge) -> list[str]:
    """Return the names of the published events, which wait for a session."""
    return [event.name for event, _ in bridge._node._events._waiting]


class Refusing:
    """A socket that refuses to send so often, and receives nothing but errors."""

    def __init__(self, times: int) -> None:
        self.times = times
        self.sent: list[bytes] = []

    def recvfrom(self, *_: int) -> object:
        raise OSError(errno.ENETDOWN, "Network is down")

    def sendto(self, datagram: bytes, _: object) -> None:
        if self.times:
            self.times -= 1
            raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
        self.sent.append(datagram)

    def close(self) -> None:
        """Close nothing."""

    @property
    def motions(self) -> list[bytes]:
        """The motion commands among what was sent."""
        return [datagram for datagram in self.sent if datagram in (STOP, BREAK)]


def refusing(bridge: Bridge, times: int) -> Refusing:
    """Make the system refuse so many datagrams."""
    bridge._sockets.close()
    made = Refusing(times)
    bridge._sockets.sockets = [made, made]  # type: ignore[list-item]
    return made


def receive_motion(bridge: Bridge, command: Command, seq: int = 1) -> None:
    """Receive this command from safety."""
    motion = Motion(command=command, seq=seq, boot=1)
    bridge._on_motion(Arrival(motion, "k", clock.now_ns(), None))


def ticks(bridge: Bridge) -> None:
    """Tick while the lease lives."""
    bridge._on_tick(clock.now_ns())


def test_a_network_that_fails_is_silence(bridge: Bridge) -> None:
    refusing(bridge, 0)
    assert list(bridge._sockets.read(0, 1)) == []


@pytest.mark.parametrize("times", [0, 1, 3])
def test_a_brake_that_cannot_be_sent_is_tried_again_at_once(bridge: Bridge, times: int) -> None:
    made = refusing(bridge, times)
    receive_motion(bridge, Command.BRAKE)
    assert (made.sent, bridge._sockets.send_errors) == ([BREAK], times)


def test_a_brake_that_cannot_be_sent_at_once_is_tried_again_at_each_tick(bridge: Bridge) -> None:
    made = refusing(bridge, 4)
    receive_motion(bridge, Command.BRAKE)
    assert made.motions == []
    made.times = 10**9
    ticks(bridge)
    made.times = 0
    ticks(bridge)
    assert made.motions == [BREAK]
    ticks(bridge)
    assert made.motions == [BREAK]
    made.times = 4
    receive_motion(bridge, Command.BRAKE, seq=2)
    receive_motion(bridge, Command.STOP, seq=3)  # a newer order takes its place
    ticks(bridge)
    assert made.motions == [BREAK, STOP]


def test_what_cannot_be_sent_is_counted_and_told(bridge: Bridge) -> None:
    refusing(bridge, 3)
    for seq in (1, 2, 3):
        receive_motion(bridge, Command.STOP, seq)
    bridge._on_second(0)
    bridge._on_tick(clock.now_ns())
    assert bridge._node.counters["send_errors"] == 3
    link = bridge._publishers["link"].last
    assert isinstance(link, Link)
    assert link.send_errors == 3
