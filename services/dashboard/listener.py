"""Listening socket that accepts each new connection, and limits of each connection.

uvicorn's own limit refuses the newest request, and has none for the time of a header or of a TLS
handshake: requests that never end would keep out the emergency stop. Of the connections that are
no WebSocket, ``REQUESTS`` stay open; beyond these the oldest one is closed.

Nor does uvicorn limit what one connection may send: it answers each ping. A connection that sends
more than ``BYTES_RATE`` is closed. A driving browser sends 2 kB/s.

asyncio accepts, receives and closes through these methods; uvloop does not.
"""

import contextlib
import socket
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from common import clock
from common.freshness import NS_PER_S

if TYPE_CHECKING:
    from typing_extensions import Buffer

BACKLOG = 128  # connections that the kernel has accepted
REQUESTS = 192
# Connections per turn of the event loop. A request is read some turns after its connection was
# accepted; ``REQUESTS`` newer ones must not displace it before.
ACCEPTED = 16
CHUNK = 1024  # bytes received at once, so that connections take turns
BYTES_RATE, BYTES_BURST = 8_192, 20_480  # per second, and after a pause

Peer = tuple[str, int]  # address and port


class Connection(socket.socket):
    """An accepted connection."""

    def __init__(
        self,
        accepted: socket.socket,
        counters: Counter[str],
        on_close: Callable[["Connection"], None],
    ) -> None:
        super().__init__(fileno=accepted.detach())
        self._counters = counters
        self._on_close = on_close
        self._left: float = BYTES_BURST  # bytes that it may send now
        self._metered_ns = clock.now_ns()

    def recv(self, size: int, flags: int = 0, /) -> bytes:
        """Receive a chunk."""
        data = super().recv(min(size, CHUNK), flags)
        self._meter(len(data))
        return data

    def recv_into(self, buffer: "Buffer", nbytes: int = 0, flags: int = 0, /) -> int:
        """Receive a chunk, as TLS does."""
        room = min(nbytes or memoryview(buffer).nbytes, CHUNK)
        count = super().recv_into(buffer, room, flags)
        self._meter(count)
        return count

    def disconnect(self) -> None:
        """Shut down the connection in any state; asyncio closes it."""
        with contextlib.suppress(OSError):
            self.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection."""
        super().close()
        self._on_close(self)

    def _meter(self, count: int) -> None:
        now_ns = clock.now_ns()
        gained = BYTES_RATE * (now_ns - self._metered_ns) / NS_PER_S
        self._metered_ns = now_ns
        self._left = min(BYTES_BURST, self._left + gained) - count
        if self._left < 0:
            self._counters["connections_aborted"] += 1
            raise ConnectionAbortedError("too many bytes")


class Listener(socket.socket):
    """A listening socket, and its connections that are no WebSocket, the oldest first."""

    def __init__(self, family: int, counters: Counter[str]) -> None:
        super().__init__(family, socket.SOCK_STREAM)
        self.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._counters = counters
        self._accepted = 0  # in this turn of the event loop
        self._requests: dict[Peer, Connection] = {}

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection; disconnect the oldest request if there are too many."""
        self._accepted = (self._accepted + 1) % (ACCEPTED + 1)
        if self._accepted == 0:
            raise BlockingIOError  # asyncio goes on in its next turn
        accepted, address = super().accept()
        peer = address[:2]
        connection = Connection(accepted, self._counters, lambda ended: self._forget(peer, ended))
        self._requests.pop(peer, None)
        self._requests[peer] = connection
        if len(self._requests) > REQUESTS:
            self._counters["requests_displaced"] += 1
            self._requests.pop(next(iter(self._requests))).disconnect()
        return connection, address

    def upgraded(self, client: Peer | None) -> None:
        """Note that the connection of this client has become a WebSocket."""
        if client:
            self._requests.pop(client, None)

    def _forget(self, peer: Peer, ended: Connection) -> None:
        if self._requests.get(peer) is ended:
            del self._requests[peer]
