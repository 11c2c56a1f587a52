"""Interfaces of an adapter, the socket to the board, and the payload of the other buses."""

import socket
import struct
from collections.abc import Callable
from importlib import import_module
from typing import Protocol, cast

import msgpack

from bench.reaction.loop import BREAK, STOP, command, is_hit

STAMP = struct.Struct("<Bq")
HIT = b"\1"  # payload of a hit and of its answer

Twist = Callable[[float, float], object]  # takes m/s, rad/s


class PathAdapter(Protocol):
    """Adapter of the benchmarks ``command`` and ``telemetry``; ``where`` is the bus's address."""

    def source(self, where: str) -> Twist:
        """Return a function that publishes a twist."""

    def subscribe(self, where: str, take: Twist) -> None:
        """Pass received twists on until killed."""


class PairAdapter(Protocol):
    """Adapter of the benchmark ``reaction``."""

    def board(self, sock: "BoardSocket", where: str) -> None:
        """Run the process at the board until killed."""

    def decide(self, where: str) -> None:
        """Run the process that decides until killed."""


def path_adapter(name: str) -> PathAdapter:
    """Import an adapter."""
    return cast(PathAdapter, import_module(f"bench.adapters.{name}"))


def pair_adapter(name: str) -> PairAdapter:
    """Import an adapter."""
    return cast(PairAdapter, import_module(f"bench.adapters.{name}"))


class BoardSocket:
    """The socket to the board."""

    def __init__(self, port: int) -> None:
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(("127.0.0.1", port))
        self._stop, self._brake = command(STOP), command(BREAK)
        self._board = ("127.0.0.1", port)

    def receive_hit(self) -> bool:
        """Wait for a datagram; return whether it is a hit, else answer STOP."""
        datagram, self._board = self.sock.recvfrom(2048)
        if is_hit(datagram):
            return True
        self.sock.sendto(self._stop, self._board)
        return False

    def brake(self) -> None:
        """Send BRAKE; callable from any thread."""
        self.sock.sendto(self._brake, self._board)


def stamped(kind: int, at_ns: int) -> bytes:
    """Encode for the vehicle which frame ended the path, and when (monotonic clock)."""
    return STAMP.pack(kind, at_ns)


def packed(linear: float, angular: float) -> bytes:
    """Encode a twist as MessagePack, a map like in T2's messages."""
    raw: bytes = msgpack.packb({"linear": linear, "angular": angular})
    return raw


def unpacked(raw: bytes) -> tuple[float, float]:
    """Decode a twist."""
    fields = msgpack.unpackb(raw)
    return fields["linear"], fields["angular"]
