"""E-STOP and page while a client abuses the web server."""

import contextlib
import resource
import socket
import ssl
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from tests.dashboard.bus_fixture import Peer
from tests.dashboard.viewer import Client, connected, half_open
from verification.harness.certificates import Site
from verification.harness.dashboard import Server, dashboard
from verification.harness.waiting import wait_until

ESTOP_S = 0.5  # from the request to the bus, at worst
HALF_OPEN = 500
FILES = 512  # that the dashboard may have open, about half of what systemd allows
MESSAGE_TOO_BIG = 1009  # RFC 6455
PING = bytes([0x89, 0x80, 0, 0, 0, 0])


def posted(server: Server) -> None:
    request = urllib.request.Request(
        f"{server.url}estop/001", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with urllib.request.urlopen(request, timeout=10, context=server.tls) as answer:
        assert answer.status == 200


def estop_s(peer: Peer, request_estop: Callable[[], None]) -> float:
    """Return the time from asking for an emergency stop to its arrival on the bus."""
    peer.latched = ("estop",)
    peer.wait_for_silence()
    peer.estops.clear()
    peer.latched = ()
    began = time.monotonic()
    request_estop()
    wait_until(lambda: peer.estops, "the emergency stop on the bus", 10)
    peer.latched = ("estop",)
    return time.monotonic() - began


def silent(server: Server, count: int) -> contextlib.ExitStack:
    """Open this many connections that send nothing: with TLS, handshakes that never end."""
    stack = contextlib.ExitStack()
    for _ in range(count):
        stack.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=5))
    return stack


def test_an_emergency_stop_beside_requests_that_never_end(server: Server, peer: Peer) -> None:
    resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (FILES, FILES))
    with half_open(server, HALF_OPEN):
        assert estop_s(peer, lambda: posted(server)) < ESTOP_S


def test_an_emergency_stop_beside_tls_handshakes_that_never_end(
    endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    member = Site(tmp_path / "keys").member("robot", "001", "--address", "127.0.0.1")
    sets = (
        f"dashboard.certificate={member.certificate}",
        f"dashboard.private_key={member.private_key}",
    )
    context = ssl.create_default_context(cafile=member.ca)
    with dashboard(endpoint, tmp_path, *sets, tls=context) as server:
        resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (FILES, FILES))
        with silent(server, HALF_OPEN):
            assert estop_s(peer, lambda: posted(server)) < ESTOP_S


def test_a_message_that_becomes_large_by_decompression_is_refused(server: Server) -> None:
    with connected(server) as it:
        it.socket.send(" " * 10_000_000)  # 10 kB on the wire
        with pytest.raises(ConnectionClosed) as caught:
            it.wait_for("nothing of the kind")
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == MESSAGE_TOO_BIG


def test_a_viewer_that_floods_is_disconnected(server: Server) -> None:
    def flood(it: Client) -> None:
        while True:
            it.socket.socket.sendall(PING * 1000)
            it.next_snapshot()

    with connected(server) as it, pytest.raises((ConnectionClosed, OSError)):
        flood(it)
