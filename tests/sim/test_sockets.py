import socket
from collections.abc import Iterator
from select import select

import msgspec
import pytest

from common.settings import Board
from sim.simulation import Reply
from sim.sockets import BURST, HOST, BoardSocket, answer_requests, bound, drain
from tests.sim.sim_fixture import SimFixture
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S, wait_until


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


def test_nobody_but_the_pc_is_received(pc: socket.socket) -> None:
    board, port = board_for(pc)
    with board.sock, bound("127.0.0.1", 0, "test") as stranger:
        stranger.sendto(b"theirs", board.sock.getsockname())
        pc.sendto(b"ours", board.sock.getsockname())
        got: list[tuple[bytes, int]] = []

        def arrived() -> bool:
            got.extend(board.receive())
            return bool(got)

        wait_until(arrived, "a datagram")
    assert got == [(b"ours", port)]


def test_a_flood_is_read_in_bursts(pc: socket.socket) -> None:
    with bound("127.0.0.1", 0, "test") as sender:
        for _ in range(BURST + 10):
            sender.sendto(b"x", pc.getsockname())
        assert len(list(drain(pc))) <= BURST


# --- the control socket -------------------------------------------------------------------------


@pytest.mark.parametrize("text", [b"", b"\xff", b'{"do": "dance"}', b"[" * 60_000])
def test_what_is_no_request_is_answered_with_the_reason(text: bytes, pc: socket.socket) -> None:
    with bound(HOST, 0, "test") as control:
        pc.sendto(text, control.getsockname())
        assert select([control], [], [], PATIENCE_S)[0]
        answer_requests(control, SimFixture().simulation, 0)
        reply = msgspec.json.decode(received(pc)[0], type=Reply)
    assert not reply.ok
    assert reply.error
