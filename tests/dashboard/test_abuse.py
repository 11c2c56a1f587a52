"""E-STOP and page while a client abuses the web server."""

import contextlib
import resource
import socket
import ssl
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from websockets.exceptions import ConnectionClosed, InvalidStatus

from services.dashboard.listener import RESERVE
from tests.dashboard.bus_fixture import Peer
from verification.harness.dashboard import (
    Client,
    Server,
    connected,
    dashboard,
    half_open,
)
from verification.harness.waiting import wait_until

ESTOP_S = 0.5  # from the request to the bus, at worst
TRIES = 4
HALF_OPEN = 500
FILES = 512  # that the dashboard may have open, about half of what systemd allows


def is_closed(it: socket.socket) -> bool:
    """Return whether the server has ended a connection."""
    it.setblocking(False)
    try:
        return it.recv(4096) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def report(text: str) -> None:
    """Print a figure; shown with ``-s``."""
    sys.stdout.write(f"{text}\n")


def posted(server: Server) -> None:
    request = urllib.request.Request(
        f"{server.url}estop/001", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with urllib.request.urlopen(request, timeout=10) as answer:
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


def said(server: Server) -> None:
    with connected(server) as it:
        it.send("estop")


def test_requests_that_never_end_are_ended(endpoint: str, peer: Peer, tmp_path: Path) -> None:
    with dashboard(endpoint, tmp_path) as server:
        resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (FILES, FILES))
        with half_open(server, HALF_OPEN) as opened:
            began = time.monotonic()
            by_request = worst_s(peer, lambda: posted(server))
            wait_until(lambda: all(map(is_closed, opened)), "the end of all half-open requests")
            report(f"E-STOP {by_request:.3f} s; all ended after {time.monotonic() - began:.1f} s")
    assert by_request < ESTOP_S


def status_of(server: Server) -> int:
    try:
        with urllib.request.urlopen(server.url, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def test_beyond_the_limit_only_an_emergency_stop_is_served(
    endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    limit = 8
    with (
        dashboard(endpoint, tmp_path, f"dashboard.connections_per_address={limit}") as server,
        contextlib.ExitStack() as viewers,
    ):
        for _ in range(limit):
            viewers.enter_context(connected(server))
        assert status_of(server) == 503
        with pytest.raises(InvalidStatus):
            viewers.enter_context(connected(server))
        with half_open(server, 2 * RESERVE) as opened:
            assert worst_s(peer, lambda: posted(server)) < ESTOP_S
            assert sum(map(is_closed, opened)) >= RESERVE  # the oldest made room
        viewers.close()
        wait_until(lambda: status_of(server) == 200, "the page, once there is room")


def test_an_emergency_stop_among_messages_that_are_dropped(server: Server, peer: Peer) -> None:
    peer.latched = ("estop",)
    peer.wait_for_silence()
    peer.estops.clear()
    with connected(server) as it:
        for _ in range(300):  # more than a burst, less than abuse
            it.send("free")
        it.send("estop", robot="001")
        wait_until(lambda: peer.estops, "the emergency stop")
        while (rest := it.wait_for("slow")) and not dropped(rest):
            pass


def dropped(rest: dict[str, Any]) -> int:
    """Return the count of dropped messages in the dashboard's health; 0 until there is one."""
    own = [one for one in rest["services"] if one["name"] == "dashboard"]
    return sum(int(one["counters"].get("messages_dropped", 0)) for one in own)


def test_a_viewer_that_keeps_flooding_is_disconnected(server: Server) -> None:
    def go_on(it: Client) -> None:
        for _ in range(600):
            it.send("free")
        it.wait_for("never")

    with connected(server) as it, pytest.raises(ConnectionClosed):
        go_on(it)


def test_a_tls_handshake_that_never_ends_is_ended(endpoint: str, tmp_path: Path) -> None:
    certificate, key = self_signed(tmp_path)
    sets = (f"dashboard.certificate={certificate}", f"dashboard.private_key={key}")
    context = ssl.create_default_context(cafile=certificate)
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(
            dashboard(endpoint, tmp_path, "dashboard.request_timeout=1.0", *sets, tls=context)
        )
        opened = [
            stack.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            for _ in range(4)
        ]
        wait_until(lambda: all(map(is_closed, opened)), "their end")
        assert server.serves()


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
