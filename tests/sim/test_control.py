import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import msgspec
import pytest

from common.errors import LinkError, MessageError
from sim.injection import Reply
from sim.requests import Bumper, RemoveBox
from sim.sockets import HOST, Control, ControlSocket
from tests.sim.sim_fixture import SimFixture
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S


@contextmanager
def served(sim: SimFixture) -> Iterator[int]:
    """Serve a sim's control socket in a thread, and name its port."""
    port = free_port(socket.SOCK_DGRAM)
    control = ControlSocket(port, sim.injection)
    control.sock.settimeout(0.05)  # waits a little instead of turning at full speed
    ended = threading.Event()
    with closing(control):
        thread = threading.Thread(target=_serve, args=(control, sim, ended.is_set))
        thread.start()
        try:
            yield port
        finally:
            ended.set()
            thread.join(PATIENCE_S)


def _serve(control: ControlSocket, sim: SimFixture, ended: Callable[[], bool]) -> None:
    while not ended():
        try:
            control.serve(sim.now_ns)
        except TimeoutError:
            continue


def test_a_client_does_and_asks() -> None:
    with served(SimFixture()) as port:
        control = Control(port, PATIENCE_S)
        assert not control.truth().pressed
        assert control.do(Bumper(pressed=True)) == Reply(ok=True)
        assert control.truth().pressed


def test_a_client_is_told_why_it_is_refused() -> None:
    with (
        served(SimFixture()) as port,
        pytest.raises(MessageError, match="no box is called 'crate'"),
    ):
        Control(port, PATIENCE_S).do(RemoveBox(name="crate"))


@pytest.mark.parametrize("text", [b"", b"\xff", b"{", b'{"do": "dance"}', b"[" * 60_000])
def test_what_is_no_request_is_answered_with_the_reason(text: bytes) -> None:
    with served(SimFixture()) as port, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(PATIENCE_S)
        sock.sendto(text, (HOST, port))
        reply = msgspec.json.decode(sock.recv(4096), type=Reply)
    assert not reply.ok
    assert reply.error


def test_nobody_there_is_a_link_error() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with pytest.raises(LinkError, match="control socket"):
        Control(port, timeout_s=0.2).truth()
