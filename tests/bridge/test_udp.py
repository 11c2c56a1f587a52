"""The sockets on loopback: bursts, and what is dropped."""

import socket
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest

from common import clock
from common.settings import Board
from services.bridge.udp import BURST, BURST_PAUSE_S, Sockets
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


@contextmanager
def sockets_of(peer: socket.socket) -> Iterator[Sockets]:
    ports = (free_port(socket.SOCK_DGRAM),)
    with closing(Sockets(Board(port=peer.getsockname()[1], listen_ports=ports))) as sockets:
        yield sockets


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        yield peer


def received(sockets: Sockets) -> bytes:
    """Wait for one datagram."""
    came: list[bytes] = []

    def come() -> list[bytes]:
        came.extend(datagram for _, datagram, _ in sockets.read(0))
        return came

    wait_until(come, "a datagram")
    assert len(came) == 1
    return came[0]


def test_a_flood_is_read_in_bursts_with_a_breath_after_each(
    peer: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    with sockets_of(peer) as sockets:
        for _ in range(BURST + 1):
            peer.sendto(b"frame", sockets.sockets[0].getsockname())
        slept: list[float] = []
        monkeypatch.setattr(clock, "now_ns", lambda: 0)  # no stall of this host ends a burst
        monkeypatch.setattr(time, "sleep", slept.append)
        assert len(list(sockets.read(0))) == BURST
        assert slept == [BURST_PAUSE_S]
        assert len(list(sockets.read(0))) == 1
        assert slept == [BURST_PAUSE_S]


def test_a_round_ends_when_its_datagrams_take_too_long(
    peer: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    with sockets_of(peer) as sockets:
        for _ in range(8):
            peer.sendto(b"frame", sockets.sockets[0].getsockname())
        now_ns = [0]
        slept: list[float] = []
        monkeypatch.setattr(clock, "now_ns", lambda: now_ns[0])
        monkeypatch.setattr(time, "sleep", slept.append)
        for _ in sockets.read(0):
            now_ns[0] += 2_000_000  # of handling
        assert (now_ns[0], slept) == (6_000_000, [BURST_PAUSE_S])
        assert len(list(sockets.read(0))) == 5


def test_a_strangers_datagram_is_not_yielded(peer: socket.socket) -> None:
    with (
        sockets_of(peer) as sockets,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign,
    ):
        where = sockets.sockets[0].getsockname()
        foreign.bind(("127.0.0.1", 0))
        foreign.sendto(b"foreign", where)
        peer.sendto(b"board", where)
        assert received(sockets) == b"board"
        assert (sockets.refused, sockets.last_foreign_source) == (1, foreign.getsockname())


def test_a_relays_report_comes_from_its_own_port_and_is_taken_once(peer: socket.socket) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as relay:
        relay.bind(("127.0.0.1", 0))
        ports = (free_port(socket.SOCK_DGRAM),)
        relay_port = relay.getsockname()[1]
        board = Board(port=peer.getsockname()[1], listen_ports=ports, relay_port=relay_port)
        sockets = Sockets(board)
        where = sockets.sockets[0].getsockname()
        relay.sendto(b"old", where)
        relay.sendto(b"report", where)
        peer.sendto(b"board", where)
        assert received(sockets) == b"board"
        assert (sockets.take_relay_report(), sockets.take_relay_report()) == (b"report", b"")
        assert sockets.refused == 0
        sockets.close()
