"""Listening socket with limits: connections, time of a request, bytes received.

The limits apply before TLS and HTTP, so that an endless handshake or header is bounded, too.
asyncio accepts, receives and closes through these methods; uvloop does not.
"""

import asyncio
import contextlib
import itertools
import socket
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from common import clock
from services.dashboard.admission import (
    Admission,
    Place,
    RateLimit,
    Verdict,
    network_of,
)
from services.dashboard.config import Dashboard

if TYPE_CHECKING:
    from typing_extensions import Buffer

RESERVE = 32  # connections
CHUNK = 1024  # bytes received at once, so that connections take turns
BYTES_RATE, BYTES_BURST = 8_192, 20_480  # per second; a driving browser sends 2 kB/s
# Of all connections, in the health message.
COUNTERS = (
    "connections_refused", "connections_aborted", "requests_timed_out", "messages_dropped",
    "viewers_closed",
)  # fmt: skip


class Connection(socket.socket):
    """An accepted connection, with a deadline until it becomes a WebSocket.

    A download renews its deadline with each part that the client takes.
    """

    def __init__(
        self, fileno: int, place: Place, counters: Counter[str], on_close: Callable[[], None]
    ) -> None:
        super().__init__(fileno=fileno)
        self.place = place
        self.start_deadline: Callable[[], asyncio.TimerHandle] | None = None
        self.deadline: asyncio.TimerHandle | None = None
        self._counters = counters
        self._on_close = on_close
        self._bytes = RateLimit(BYTES_RATE, BYTES_BURST)

    def recv(self, size: int, flags: int = 0, /) -> bytes:
        """Receive a chunk; disconnect an abusive peer."""
        data = super().recv(min(size, CHUNK), flags)
        self._meter(len(data))
        return data

    def recv_into(self, buffer: "Buffer", nbytes: int = 0, flags: int = 0, /) -> int:
        """Receive a chunk, as TLS does; disconnect an abusive peer."""
        room = min(nbytes or memoryview(buffer).nbytes, CHUNK)
        count = super().recv_into(buffer, room, flags)
        self._meter(count)
        return count

    def lift_deadline(self) -> None:
        """Cancel the deadline: the connection has become a WebSocket."""
        if self.deadline is not None:
            self.deadline.cancel()

    def renew_deadline(self) -> None:
        """Start the deadline anew."""
        self.lift_deadline()
        if self.start_deadline is not None:
            self.deadline = self.start_deadline()

    def disconnect(self) -> None:
        """Shut down the connection in any state."""
        with contextlib.suppress(OSError):
            self.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection and free its place."""
        super().close()
        self.lift_deadline()
        self._on_close()

    def _meter(self, count: int) -> None:
        if self._bytes.take(clock.now_ns(), count) is not Verdict.ACCEPTED:
            self._counters["connections_aborted"] += 1
            raise ConnectionAbortedError("too many bytes")


class Listener(socket.socket):
    """A listening socket that admits connections through ``Admission``."""

    def __init__(self, family: int, settings: Dashboard) -> None:
        super().__init__(family, socket.SOCK_STREAM)
        self.counters: Counter[str] = Counter(dict.fromkeys(COUNTERS, 0))
        self._request_s = settings.request_timeout
        self._admission = Admission(settings.connections, settings.connections_per_address, RESERVE)
        self._numbers = itertools.count()
        self._open: dict[int, Connection] = {}
        self._by_peer: dict[tuple[str, int], Connection] = {}

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection; disconnect one that must make room for it."""
        accepted, address = super().accept()
        number, peer = next(self._numbers), address[:2]
        place, ended = self._admission.admit(number, network_of(address[0]))
        if ended is not None:
            self.counters["connections_refused"] += 1
            self._open[ended].disconnect()
        connection = Connection(
            accepted.detach(), place, self.counters, lambda: self._forget(number, peer)
        )
        self._open[number] = self._by_peer[peer] = connection
        loop = asyncio.get_running_loop()
        connection.start_deadline = partial(
            loop.call_later, self._request_s, self._overdue, connection
        )
        connection.renew_deadline()
        return connection, address

    def connection(self, client: tuple[str, int] | None) -> Connection | None:
        """Return the connection of a client's address and port."""
        return self._by_peer.get(client) if client else None

    def _overdue(self, connection: Connection) -> None:
        self.counters["requests_timed_out"] += 1
        connection.disconnect()

    def _forget(self, number: int, peer: tuple[str, int]) -> None:
        self._admission.release(number)
        connection = self._open.pop(number, None)
        if self._by_peer.get(peer) is connection:
            self._by_peer.pop(peer, None)
