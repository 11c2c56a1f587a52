"""Test doubles around a service: clock, Zenoh session, the board's socket, log.

All code of T2 runs as shipped, up to the call into Zenoh, the kernel or the log's thread. The
doubles drop encoded data.
"""

import logging
import socket
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import patch

import zenoh

from common import clock, codec
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.loop import Loop
from common.messages import Message
from services.bridge.rx_timestamp import SO_TIMESTAMPNS, TIMESPEC

START_NS = 1_000 * NS_PER_S
WALL_NS = 1_700_000_000 * NS_PER_S  # ahead of the monotonic clock
LATENCY_NS = 50_000  # from the kernel's time stamp to the read
BOOT = 2**62 + 1  # always as long in MessagePack and in memory


class Clock:
    """A clock that the replay advances."""

    def __init__(self) -> None:
        self.now_ns = START_NS

    def install(self) -> None:
        """Replace the clocks of this process."""
        clock.now_ns = lambda: self.now_ns  # type: ignore[assignment]
        time.time_ns = lambda: WALL_NS + self.now_ns


@dataclass(frozen=True, slots=True)
class Sample:
    """A sample as Zenoh passes it to a callback."""

    key_expr: zenoh.KeyExpr
    payload: zenoh.ZBytes
    attachment: zenoh.ZBytes | None


class Session:
    """A Zenoh session without a network."""

    def __init__(self, bus: Bus, loop: Loop) -> None:
        self.info = self
        self.sent: dict[str, bytes] = {}  # the newest of each key
        self._queues: dict[str, Callable[[Any], None]] = {}
        self._loop = loop
        with patch("zenoh.ext.declare_advanced_publisher", Session.declare_publisher):
            bus._adopt(cast("zenoh.Session", self))

    def declare_transport_events_listener(
        self, opened: Callable[[Any], None], *, history: bool
    ) -> None:
        """Report one open transport."""
        opened(SimpleNamespace(kind=zenoh.SampleKind.PUT))

    def declare_publisher(self, key: str, **_: object) -> "Sink":
        """Return a publisher."""
        return Sink(self, key)

    def declare_subscriber(self, key: str, queue: Callable[[Any], None]) -> None:
        """Store the callback."""
        self._queues[key] = queue

    def declare_queryable(self, key: str, channel: object) -> SimpleNamespace:
        """Return a queryable without queries."""
        return SimpleNamespace(try_recv=lambda: None)

    def deliver(self, key: str, message: Message, subscription: str) -> None:
        """Deliver a message as Zenoh's thread does while the loop sleeps: it is handled soon."""
        self.deliver_encoded(key, codec.encode(message), subscription)

    def deliver_encoded(self, key: str, payload: bytes, subscription: str) -> None:
        """Deliver an encoded message in the same way."""
        sample = Sample(zenoh.KeyExpr(key), zenoh.ZBytes(payload), None)
        self._loop._lock.release()
        self._queues[subscription](sample)
        self._loop._lock.acquire()
        self._loop._make(self._loop._posted)  # a sample right behind another one is the loop's
        assert self._loop._error is None, self._loop._error


class Sink:
    """A declared publisher."""

    matching = True  # there is a subscriber

    def __init__(self, session: Session, key: str) -> None:
        self._session = session
        self.key = key
        self.matching_status = self

    def put(self, payload: bytes, attachment: bytes | None = None) -> None:
        """Store the newest message."""
        self._session.sent[self.key] = payload


class BoardSocket(socket.socket):
    """A socket to a board that answers queries."""

    def __init__(self, clock: Clock, board: tuple[str, int], answers: dict[bytes, bytes]) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_DGRAM)  # a descriptor that the loop can watch
        self.inbox: deque[bytes] = deque()
        self.sent = b""
        self._clock = clock
        self._board = board
        self._answers = answers  # by query

    def recvmsg(self, *_: object) -> tuple[bytes, list[tuple[int, int, bytes]], int, object]:
        """Return the next datagram with a kernel time stamp."""
        if not self.inbox:
            raise BlockingIOError
        stamp = TIMESPEC.pack(*divmod(WALL_NS + self._clock.now_ns - LATENCY_NS, NS_PER_S))
        return self.inbox.popleft(), [(socket.SOL_SOCKET, SO_TIMESTAMPNS, stamp)], 0, self._board

    def sendto(self, datagram: bytes, *_: object) -> None:  # type: ignore[override]
        """Record a command, and queue its answer."""
        self.sent = datagram
        if datagram in self._answers:
            self.inbox.append(self._answers[datagram])


class DroppedLines(logging.Handler):
    """A log without a file and without a thread, which formats nothing."""

    def __init__(self, *_: object) -> None:
        super().__init__()

    def emit(self, record: logging.LogRecord) -> None:
        """Drop a line."""

    def drain(self) -> None:
        """Return at once: no line waits."""
