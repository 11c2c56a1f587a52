import socket
from collections.abc import Iterator
from contextlib import closing

import pytest

from common.errors import LinkError
from common.settings import Board
from sim.faults import Datagram
from sim.sockets import BURST, BoardSocket, bound, drain
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


@pytest.fixture
def pc() -> Iterator[socket.socket]:
    with bound("127.0.0.1", 0, "test") as sock:
        yield sock


def board_for(pc: socket.socket) -> tuple[BoardSocket, int]:
    """Return a board whose PC is this socket, and the socket's port."""
    port = pc.getsockname()[1]
    settings = Board(port=free_port(socket.SOCK_DGRAM), listen_ports=(port,))
    return BoardSocket(settings), port


def received(sock: socket.socket) -> tuple[bytes, tuple[str, int]]:
    """Return the next datagram of a socket and its sender."""
    got: list[tuple[bytes, tuple[str, int]]] = []

    def arrived() -> bool:
        got.extend(drain(sock))
        return bool(got)

    wait_until(arrived, "a datagram")
    return got[0]


def test_it_tells_the_pc_from_everybody_else(pc: socket.socket) -> None:
    board, port = board_for(pc)
    with closing(board), bound("127.0.0.1", 0, "test") as stranger:
        pc.sendto(b"ours", board.sock.getsockname())
        stranger.sendto(b"theirs", board.sock.getsockname())
        got: dict[bytes, int | None] = {}

        def both() -> bool:
            got.update(board.receive())
            return len(got) == 2

        wait_until(both, "both")
    assert got == {b"ours": port, b"theirs": None}


def test_it_sends_from_its_own_address_or_from_a_foreign_one(pc: socket.socket) -> None:
    board, port = board_for(pc)
    with closing(board):
        board.send(Datagram(b"own", port))
        assert received(pc) == (b"own", board.sock.getsockname())
        board.send(Datagram(b"other", port, foreign=True))
        payload, sender = received(pc)
    assert payload == b"other"
    assert sender[0] not in ("127.0.0.1", "0.0.0.0")


@pytest.mark.parametrize("address", ["127.0.0.2", "0.0.0.0"])
def test_the_foreign_address_is_always_another(address: str) -> None:
    port = free_port(socket.SOCK_DGRAM)
    board = BoardSocket(Board(address=address, listen_address=address, port=port))
    with closing(board):
        board.send(Datagram(b"nobody listens", 4001, foreign=True))
        assert board._foreign.getsockname()[:2] != board.sock.getsockname()[:2]


def test_what_cannot_be_sent_is_counted(pc: socket.socket) -> None:
    board, port = board_for(pc)
    with closing(board):
        board.send(Datagram(bytes(70_000), port))
    assert board.unsent == 1


def test_a_taken_port_is_named_with_its_setting(pc: socket.socket) -> None:
    port = pc.getsockname()[1]
    settings = Board(port=port, listen_ports=(free_port(socket.SOCK_DGRAM),))
    with pytest.raises(LinkError, match=rf"board.port: cannot listen on UDP port {port} of 127"):
        BoardSocket(settings)


def test_a_flood_is_read_in_bursts(pc: socket.socket) -> None:
    with bound("127.0.0.1", 0, "test") as sender:
        for _ in range(BURST + 10):
            sender.sendto(b"x", pc.getsockname())
        assert len(list(drain(pc))) <= BURST
