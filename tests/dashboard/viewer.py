"""WebSocket clients in place of browsers, and connections that stay half open."""

import contextlib
import json
import socket
from collections.abc import Iterator
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from verification.harness.dashboard import Server
from verification.harness.waiting import PATIENCE_S


class Client:
    """A viewer: stores the newest message of each kind."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.received: dict[str, Any] = {}

    def send(self, k: str, **fields: object) -> None:
        self.socket.send(json.dumps({"k": k, **fields}))

    def next_snapshot(self) -> dict[str, Any]:
        """Wait for the next fast snapshot."""
        while True:
            message = json.loads(self.socket.recv(timeout=PATIENCE_S))
            self.received[message["k"]] = message
            if message["k"] == "fast":
                return dict(message)

    def wait_for(self, kind: str) -> Any:
        """Wait for a new message of this kind."""
        self.received.pop(kind, None)
        while kind not in self.received:
            self.next_snapshot()
        return self.received[kind]

    def take_control(self, force: bool = False) -> None:
        """Take the driver lock and wait until it is granted."""
        self.send("take", force=force)
        while self.next_snapshot()["driver"]["id"] != self.received["hello"]["id"]:
            pass


@contextlib.contextmanager
def connected(server: Server, robot: str = "001") -> Iterator[Client]:
    """Show a robot while the context lasts."""
    address = f"ws://127.0.0.1:{server.port}/live?robot={robot}"
    with connect(address, origin=Origin(server.url.rstrip("/"))) as socket:
        it = Client(socket)
        it.wait_for("hello")
        yield it


@contextlib.contextmanager
def half_open(server: Server, count: int) -> Iterator[list[socket.socket]]:
    """Open this many connections, each with a request whose header never ends."""
    with contextlib.ExitStack() as stack:
        opened = []
        for _ in range(count):
            it = stack.enter_context(
                socket.create_connection(("127.0.0.1", server.port), timeout=5)
            )
            with contextlib.suppress(OSError):  # it may be closed at once
                it.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
            opened.append(it)
        yield opened
