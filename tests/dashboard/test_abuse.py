"""E-STOP and page while a client abuses the web server."""

import contextlib
import resource
import socket
import ssl
import time
import urllib.request
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from websockets.exceptions import ConnectionClosed

from tests.dashboard.bus_fixture import Peer
from verification.harness.dashboard import Client, Server, connected, dashboard, half_open
from verification.harness.waiting import wait_until

ESTOP_S = 0.5  # from the request to the bus, at worst
TRIES = 2
HALF_OPEN = 500
FILES = 512  # that the dashboard may have open, about half of what systemd allows
PING = bytes([0x89, 0x80, 0, 0, 0, 0])


def posted(server: Server) -> None:
    request = urllib.request.Request(
        f"{server.url}estop/001", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with urllib.request.urlopen(request, timeout=10, context=server.tls) as answer:
        assert answer.status == 200


def worst_s(peer: Peer, request_estop: Callable[[], None]) -> float:
    """Return the longest time from asking for an emergency stop to its arrival on the bus."""
    worst = 0.0
    for _ in range(TRIES):
        peer.latched = ("estop",)
        peer.wait_for_silence()
        peer.estops.clear()
        peer.latched = ()
        began = time.monotonic()
        request_estop()
        wait_until(lambda: peer.estops, "the emergency stop on the bus", 10)
        worst = max(worst, time.monotonic() - began)
    peer.latched = ("estop",)
    return worst


def silent(server: Server, count: int) -> contextlib.ExitStack:
    """Open this many connections that send nothing: with TLS, handshakes that never end."""
    stack = contextlib.ExitStack()
    for _ in range(count):
        stack.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=5))
    return stack


def test_an_emergency_stop_beside_requests_that_never_end(server: Server, peer: Peer) -> None:
    resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (FILES, FILES))
    with half_open(server, HALF_OPEN):
        assert worst_s(peer, lambda: posted(server)) < ESTOP_S


def test_an_emergency_stop_beside_tls_handshakes_that_never_end(
    endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    certificate, key = self_signed(tmp_path)
    sets = (f"dashboard.certificate={certificate}", f"dashboard.private_key={key}")
    context = ssl.create_default_context(cafile=certificate)
    with dashboard(endpoint, tmp_path, *sets, tls=context) as server:
        resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (FILES, FILES))
        with silent(server, HALF_OPEN):
            assert worst_s(peer, lambda: posted(server)) < ESTOP_S


def test_a_viewer_that_floods_is_disconnected(server: Server) -> None:
    def flood(it: Client) -> None:
        while True:
            it.socket.socket.sendall(PING * 100)
            it.next_snapshot()

    with connected(server) as it, pytest.raises((ConnectionClosed, OSError)):
        flood(it)


def self_signed(folder: Path) -> tuple[Path, Path]:
    """Write a certificate for 127.0.0.1 and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "127.0.0.1")])
    now = datetime.now(UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))
        .not_valid_after(now + timedelta(hours=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False
        )
        .sign(key, hashes.SHA256())
    )
    files = folder / "server.pem", folder / "server.key"
    files[0].write_bytes(made.public_bytes(serialization.Encoding.PEM))
    files[1].write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return files
