"""Ports of ``t2 up``, checked before it starts any process.

A second stack on the same ports would add a second safety service to the robot's bus. Each port is
bound once and released, then claimed while ``t2 up`` runs: of two concurrent starts, one continues.
A Unix socket is connected to instead: its file may be a stale one.
"""

import errno
import socket
import sys
import time
from collections.abc import Collection, Sequence
from contextlib import ExitStack
from typing import NamedTuple

from cli.settings import Everything
from common.settings import protocol
from t2.errors import LinkError

PATIENCE_S = 5.0  # children of a killed supervisor may still be stopping the vehicle
LOOK_S = 0.1
ABSENT = "this computer does not have this address"
KINDS = {"udp": "udp", "quic": "udp", "unixsock-stream": "unix"}  # of other protocols: tcp


class Port(NamedTuple):
    """One address that a process listens on."""

    kind: str  # tcp, udp or unix
    host: str  # or the path of a Unix socket
    number: int
    setting: str  # setting that defines it

    def __str__(self) -> str:
        number = f":{self.number}" if self.number else ""
        return f"{self.kind.upper()} {self.host}{number} ({self.setting})"


def wanted(config: Everything, names: Collection[str]) -> list[Port]:
    """Return the ports of these processes."""
    board = config.board
    found: list[Port] = []
    if "router" in names:
        found += map(_listener, config.bus.listen)
    if "bridge" in names:
        found += [
            Port("udp", board.listen_address, port, "board.listen_ports")
            for port in board.listen_ports
        ]
    if "sim" in names:
        found += [Port("udp", board.address, board.port, "board.port")]
    return found


def _listener(endpoint: str) -> Port:
    """Return the port of a router's endpoint."""
    address = endpoint.partition("/")[2].partition("?")[0].partition("#")[0]
    kind = KINDS.get(protocol(endpoint), "tcp")
    host, _, number = (address, "", 0) if kind == "unix" else address.rpartition(":")
    return Port(kind, host.strip("[]"), int(number), "bus.listen")


def claimed(ports: Sequence[Port], patience_s: float = PATIENCE_S) -> ExitStack:
    """Check that all ports are free and return the claims on them, to close at the end.

    Raise ``LinkError`` with the first port that is still taken after ``patience_s``.
    """
    end_s = time.monotonic() + patience_s
    with ExitStack() as claims:
        for port in ports:
            while reason := _taken(port, claims):
                if time.monotonic() > end_s or reason == ABSENT:
                    raise LinkError(f"{port}: {reason}; {_advice(port, reason)}")
                time.sleep(LOOK_S)
        return claims.pop_all()


def _taken(port: Port, claims: ExitStack) -> str:
    """Claim a port; return why it is not available, or an empty text."""
    try:
        (_connect if port.kind == "unix" else _bind)(port)
        if sys.platform == "linux":  # a name in the abstract namespace, free when this process ends
            sock = claims.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            sock.bind(f"\0t2-up {port.kind} {port.host} {port.number}")
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            return "used by another program"
        if error.errno == errno.EADDRNOTAVAIL:
            return ABSENT
        return f"cannot be bound: {error.strerror}"
    return ""


def _bind(port: Port) -> None:
    kind = socket.SOCK_STREAM if port.kind == "tcp" else socket.SOCK_DGRAM
    family, kind, number, _, address = socket.getaddrinfo(port.host, port.number, type=kind)[0]
    with socket.socket(family, kind, number) as sock:
        if port.kind == "tcp":  # sockets in TIME_WAIT do not block a listener
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(address)
        if port.kind == "tcp":
            sock.listen(1)


def _connect(port: Port) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as sock:
        try:
            sock.connect(port.host)
        except OSError:  # no socket, or a stale one of a killed router
            return
    raise OSError(errno.EADDRINUSE, "used by another program")


def _advice(port: Port, reason: str) -> str:
    if reason == ABSENT:
        setting = port.setting.replace("listen_ports", "listen_address")
        return f"`ip -brief address` lists its own: configure the interface, or correct {setting}"
    if port.setting == "bus.listen":
        return (
            "is a stack already running? `t2 up --no-router` uses the running router, and "
            "--set bus.listen=tcp/127.0.0.1:PORT selects another port"
        )
    return f"is a stack already running? --set {port.setting}=PORT selects another port"
