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


def test_nobody_but_the_pc_is_received(pc: socket.socket) -> None:
    port = pc.getsockname()[1]
    board = BoardSocket(Board(port=free_port(socket.SOCK_DGRAM), listen_ports=(port,)))
    with board.sock, bound("127.0.0.1", 0, "test") as stranger:
        stranger.sendto(b"theirs", board.sock.getsockname())
        pc.sendto(b"ours", board.sock.getsockname())
        assert wait_until(lambda: list(board.receive()), "a datagram") == [(b"ours", port)]


def test_a_flood_is_read_in_bursts(pc: socket.socket) -> None:
    with bound("127.0.0.1", 0, "test") as sender:
        for _ in range(BURST + 10):
            sender.sendto(b"x", pc.getsockname())
        assert len(list(drain(pc))) <= BURST


# --- the control socket -------------------------------------------------------------------------


@pytest.mark.parametrize("text", [b"\xff", b'{"do": "dance"}', b"[" * 60_000])
def test_what_is_no_request_is_answered_with_the_reason(text: bytes, pc: socket.socket) -> None:
    with bound(HOST, 0, "test") as control:
        pc.sendto(text, control.getsockname())
        assert select([control], [], [], PATIENCE_S)[0]
        answer_requests(control, SimFixture().simulation, 0)
        assert select([pc], [], [], PATIENCE_S)[0]
        reply = msgspec.json.decode(pc.recv(4096), type=Reply)
    assert not reply.ok
    assert reply.error
