"""The proxy holds back what a client sends, and releases all of it."""

import socket
from collections.abc import Iterator

import pytest

from verification.ros2.tcp_proxy import HOST, TcpProxy

PATIENCE_S = 10.0
Ends = tuple[TcpProxy, socket.socket, socket.socket]  # proxy, client, server


@pytest.fixture
def ends() -> Iterator[Ends]:
    with (
        socket.create_server((HOST, 0)) as listener,
        TcpProxy(listener.getsockname()[1]) as proxy,
        socket.create_connection((HOST, proxy.port), PATIENCE_S) as client,
    ):
        server, _ = listener.accept()
        server.settimeout(PATIENCE_S)
        with server:
            yield proxy, client, server


def received(sock: socket.socket, count: int) -> bytes:
    got = b""
    while len(got) < count:
        got += sock.recv(count - len(got))
    return got


def test_both_directions(ends: Ends) -> None:
    _, client, server = ends
    client.sendall(b"to the robot")
    assert received(server, 12) == b"to the robot"
    server.sendall(b"to the peer")
    assert received(client, 11) == b"to the peer"


def test_held_bytes_arrive_at_the_end_in_order(ends: Ends) -> None:
    proxy, client, server = ends
    server.setblocking(False)
    with proxy.hold():
        for number in range(10):
            client.sendall(b"%d" % number)
        client.settimeout(PATIENCE_S)
        server.sendall(b"!")
        assert received(client, 1) == b"!"  # the other direction flows meanwhile
        with pytest.raises(BlockingIOError):
            server.recv(1)
    server.settimeout(PATIENCE_S)
    assert received(server, 10) == b"0123456789"


def test_the_end_of_a_connection_passes(ends: Ends) -> None:
    _, client, server = ends
    client.close()
    assert server.recv(1) == b""
