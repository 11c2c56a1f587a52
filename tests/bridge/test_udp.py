"""The sockets on loopback: the kernel's stamp, and what is dropped."""

import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from common import clock
from common.freshness import NS_PER_S
from common.settings import Board
from services.bridge.rx_timestamp import Receipt
from services.bridge.udp import BURST, BURST_PAUSE_S, Sockets, enable_timestamps
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux stamps datagrams by itself")


@contextmanager
def sockets_of(peer: socket.socket) -> Iterator[Sockets]:
    ports = (free_port(socket.SOCK_DGRAM),)
    sockets = Sockets(Board(port=peer.getsockname()[1], listen_ports=ports))
    yield sockets
    sockets.close()


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        yield peer


def received(sockets: Sockets) -> tuple[bytes, Receipt]:
    """Wait for one datagram."""
    came: list[tuple[bytes, Receipt]] = []

    def come() -> list[tuple[bytes, Receipt]]:
        for _, datagram, ancillary, read_ns in sockets.read(0):
            came.append((datagram, sockets.receipt(ancillary, read_ns)))
        return came

    wait_until(come, "a datagram")
    assert len(came) == 1
    return came[0]


HELD_S = 0.01


@LINUX
def test_a_datagram_came_when_the_kernel_got_it_not_when_it_was_read(peer: socket.socket) -> None:
    with sockets_of(peer) as sockets:

        def in_time() -> bool:
            before_ns = clock.now_ns()
            peer.sendto(b"frame", sockets.sockets[0].getsockname())
            after_ns = clock.now_ns()
            time.sleep(HELD_S)  # a bridge that stalls
            datagram, receipt = received(sockets)
            assert datagram == b"frame"
            assert receipt.kernel_ns is not None
            assert receipt.read_ns >= after_ns + HELD_S * NS_PER_S
            return before_ns - 1_000 <= receipt.kernel_ns <= after_ns + 1_000

        # The kernel turns stamping on a moment later than it is asked to.
        wait_until(in_time, "a stamp of the moment of sending")
        assert sockets.wall.steps == 0


def test_a_flood_is_read_in_bursts_with_a_breath_after_each(
    peer: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    with sockets_of(peer) as sockets:
        for _ in range(BURST + 1):
            peer.sendto(b"frame", sockets.sockets[0].getsockname())
        slept: list[float] = []
        monkeypatch.setattr(time, "sleep", slept.append)
        assert len(list(sockets.read(0))) == BURST
        assert slept == [BURST_PAUSE_S]
        assert len(list(sockets.read(0))) == 1
        assert slept == [BURST_PAUSE_S]


@LINUX
def test_a_wall_clock_that_is_set_costs_stamps_and_nothing_else(
    peer: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    with sockets_of(peer) as sockets:
        where = sockets.sockets[0].getsockname()
        peer.sendto(b"before", where)
        assert received(sockets)[1].kernel_ns is not None
        true_ns = time.time_ns
        monkeypatch.setattr(time, "time_ns", lambda: true_ns() - 3 * NS_PER_S)
        # The kernel goes on by the clock of before: to us, its stamps are of the future.
        peer.sendto(b"after", where)
        datagram, receipt = received(sockets)
        assert (datagram, receipt.kernel_ns, sockets.wall.steps) == (b"after", None, 1)
        assert receipt.earliest_ns == receipt.read_ns
        monkeypatch.undo()
        peer.sendto(b"again", where)
        assert received(sockets)[1].kernel_ns is None  # stamped before we saw that it was set

        def well() -> bool:
            peer.sendto(b"well", where)
            return received(sockets)[1].kernel_ns is not None

        wait_until(well, "stamps again")
        assert sockets.wall.steps == 2


def test_without_stamps_it_came_when_it_was_read(
    peer: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    with sockets_of(peer) as sockets:
        peer.sendto(b"frame", sockets.sockets[0].getsockname())
        datagram, receipt = received(sockets)
        assert (datagram, receipt.kernel_ns) == (b"frame", None)
        assert receipt.read_ns <= clock.now_ns()


@LINUX
def test_a_kernel_that_knows_no_stamps_is_done_without() -> None:
    one, other = socket.socketpair()
    one.close()  # refuses every option
    enable_timestamps(one)
    other.close()


def test_a_strangers_datagram_is_not_yielded(peer: socket.socket) -> None:
    with (
        sockets_of(peer) as sockets,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign,
    ):
        where = sockets.sockets[0].getsockname()
        foreign.bind(("127.0.0.1", 0))
        foreign.sendto(b"foreign", where)
        peer.sendto(b"board", where)
        assert received(sockets)[0] == b"board"
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
        assert received(sockets)[0] == b"board"
        assert (sockets.take_relay_report(), sockets.take_relay_report()) == (b"report", b"")
        assert sockets.refused == 0
        sockets.close()
