"""The bridge's shell in this process: a board that starts anew, a network that fails."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from common.bus.bus import Arrival
from common.config import Sources, load
from common.freshness import S
from common.messages import Bumper, Command, Motion
from common.service import Node
from common.settings import Board as Settings
from common.wire.commands import MotionCommand, MotionKind
from common.wire.framing import Framing
from common.wire.reports import BumperReport, DistanceReport, VelocityReport
from services.bridge import bridge as shell
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.lease import Lease
from services.bridge.link import Link
from services.bridge.stamp import Receipt
from services.bridge.udp import Sockets
from tests.bridge.board import Board, board

NOW = 1_000_000_000
Gap = Callable[[Bridge, pytest.MonkeyPatch], None]


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


def test_a_board_that_starts_anew_disarms_at_once(
    bridge: Bridge, monkeypatch: pytest.MonkeyPatch
) -> None:
    bridge._wheels.lease = Lease(boot=1, ready=True, neutral=True, over_since_ns=None)
    bridge._on_distance(DistanceReport(1000, 0), b"", NOW)
    assert bridge._wheels.lease.waiting == ""
    monkeypatch.setattr(shell, "restarted", lambda *_, **__: True)
    bridge._on_distance(DistanceReport(0, 0), b"", NOW + 1)
    assert (bridge._wheels.lease.ready, bridge._wheels.lease.neutral) == (False, False)


HIT, CLEAR, STANDS, BREAK = (
    Framing().pack(frame)
    for frame in (
        BumperReport(True),
        BumperReport(False),
        VelocityReport(0, 0),
        MotionCommand(MotionKind.BREAK),
    )
)


@pytest.mark.parametrize("datagram", [HIT, STANDS + HIT, HIT + STANDS])
def test_a_hit_is_braked_for_once_alone_in_its_datagram_or_not(
    bridge: Bridge, monkeypatch: pytest.MonkeyPatch, datagram: bytes
) -> None:
    sent = comes(bridge, monkeypatch, 0, CLEAR, CLEAR, CLEAR, datagram, HIT, HIT)
    bridge._read(NOW)
    assert sent == [BREAK]
    assert bridge._wheels.lease.hit is not None
    timing = bridge._node.timing()
    assert timing is not None
    assert sum(timing.durations["contact_to_break"].counts) == 1


def test_a_hit_on_a_port_that_is_not_believed_is_none(
    bridge: Bridge, monkeypatch: pytest.MonkeyPatch
) -> None:
    bridge._readiness.link = Link(state="up", heard_ns=NOW)
    sent = comes(bridge, monkeypatch, 1, HIT)
    bridge._read(NOW)
    assert sent == []
    assert bridge._wheels.lease.hit is None


def comes(
    bridge: Bridge, monkeypatch: pytest.MonkeyPatch, port: int, *datagrams: bytes
) -> list[bytes]:
    """Let these wait on a port; return what is sent from now on."""
    sent: list[bytes] = []
    waiting: dict[int, Any] = {port: [(each, [], time.monotonic_ns()) for each in datagrams]}
    monkeypatch.setattr(bridge._sockets, "read", lambda port: waiting.pop(port, []))
    monkeypatch.setattr(bridge._sockets, "send", lambda datagram, _: sent.append(datagram))
    return sent


def test_a_short_hit_is_told_until_safety_has_judged_it(bridge: Bridge) -> None:
    for on in (True, False, False, False, False, False):
        bridge._on_bumper(BumperReport(on), b"", NOW)
        assert bridge._to_bumper.last is not None
        assert bridge._to_bumper.last.pressed
    bridge._wheels.lease = Lease(boot=1)
    bridge._on_bumper(BumperReport(False), b"", NOW)
    assert bridge._to_bumper.last is not None
    assert not bridge._to_bumper.last.pressed


def link_lost(bridge: Bridge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bridge, "_read", lambda _: None)
    bridge._readiness.link = Link("up", heard_ns=NOW)
    bridge._on_tick(NOW + S)
    assert bridge._readiness.link.state == "lost"


def board_restarted(bridge: Bridge, monkeypatch: pytest.MonkeyPatch) -> None:
    bridge._on_distance(DistanceReport(1000, 0), b"", NOW)
    monkeypatch.setattr(shell, "restarted", lambda *_, **__: True)
    bridge._on_distance(DistanceReport(0, 0), b"", NOW + 1)
    assert bridge._readiness.epoch > 0


@pytest.mark.parametrize("gap", [link_lost, board_restarted])
@pytest.mark.parametrize("first", [True, False])
def test_a_row_of_clear_samples_begins_anew_after_a_gap(
    bridge: Bridge, monkeypatch: pytest.MonkeyPatch, gap: Gap, first: bool
) -> None:
    told: list[Bumper] = []
    monkeypatch.setattr(bridge._to_bumper, "put", lambda message, _: told.append(message))
    for pressed in (first, False, False, *[False] * (not first)):
        bridge._on_bumper(BumperReport(pressed), b"", NOW)
    bridge._wheels.lease = Lease(boot=1)  # safety has judged the hit, if there was one
    told.clear()
    gap(bridge, monkeypatch)
    for _ in range(2):
        bridge._on_bumper(BumperReport(False), b"", NOW)
    assert told == []
    bridge._on_bumper(BumperReport(False), b"", NOW)
    assert told == [Bumper(pressed=False)]
    gap(bridge, monkeypatch)
    bridge._on_bumper(BumperReport(True), b"", NOW)
    assert bridge._wheels.lease.hit is not None


@pytest.mark.parametrize(("command", "counted"), [("stop", 0), ("brake", 1)])
def test_only_a_brake_is_the_judged_stop(bridge: Bridge, command: Command, counted: int) -> None:
    bridge._receipt = Receipt(None, time.monotonic_ns())
    bridge._on_bumper(BumperReport(True), b"", NOW)
    hit = bridge._wheels.lease.hit
    assert hit is not None
    boot = bridge._node.bus.boot
    for seq, judged in ((1, hit - 1), (2, hit), (3, hit)):
        motion = Motion(command=command, seq=seq, boot=1, judged=judged, judged_boot=boot)
        bridge._wheels.on_motion(Arrival(motion, "k", time.monotonic_ns(), None))
        durations = bridge._node.timing().durations  # type: ignore[union-attr]
        judged_already = counted if seq > 1 else 0
        assert sum(durations["judged_stop"].counts) == judged_already
    assert sum(durations["contact_to_break"].counts) == 1


class Broken:
    """A socket whose network is down."""

    def recvmsg(self, *_: int) -> object:
        raise OSError(100, "Network is down")

    def close(self) -> None:
        """Nothing to give back."""


def test_a_network_that_fails_is_silence(made: Board) -> None:
    sockets = Sockets(Settings(port=made.address[1], listen_ports=tuple(made.ports)))
    sockets.close()
    sockets.sockets = [Broken()]  # type: ignore[list-item]
    assert list(sockets.read(0)) == []
