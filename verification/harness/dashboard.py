"""The dashboard as a separate process, and WebSocket clients in place of browsers."""

import contextlib
import json
import socket
import ssl
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from verification.harness.bus import set_options
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S, wait_until

FREE_TEXT = b'{"k":"free"}'
FREE = bytes([0x81, 0x80 | len(FREE_TEXT)]) + bytes(4) + FREE_TEXT  # a frame, masked with zeros
BATCH = 500
PER_SECOND = 50_000


@dataclass
class Server:
    """The process of a dashboard."""

    command: list[str]
    port: int
    log: Path
    process: "subprocess.Popen[bytes]"
    tls: ssl.SSLContext | None = None

    @property
    def url(self) -> str:
        return f"{'https' if self.tls else 'http'}://127.0.0.1:{self.port}/"

    def start(self) -> None:
        """Start the process and wait until it serves the page."""
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(self.command, stdout=output, stderr=output)
        wait_until(self.serves, f"the page; {self.log}", 2 * PATIENCE_S)

    def serves(self) -> bool:
        assert self.process.poll() is None, self.log.read_text()
        try:
            with urllib.request.urlopen(self.url, timeout=5, context=self.tls) as answer:
                return bool(answer.status == 200)
        except urllib.error.HTTPError as error:
            return error.code == 401  # the token page
        except OSError:
            return False

    def end(self) -> None:
        """Terminate the process; kill it if it hangs."""
        self.process.terminate()
        try:
            self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def dashboard(
    endpoint: str, folder: Path, *sets: str, tls: ssl.SSLContext | None = None
) -> Iterator[Server]:
    """Run a dashboard on a free port while the context lasts."""
    port = free_port()
    given = [f"bus.connect={endpoint}", f"dashboard.port={port}", "log.format=json", *sets]
    command = [sys.executable, "-m", "services.dashboard", *set_options(*given)]
    server = Server(command, port, folder / "dashboard.log", None, tls)  # type: ignore[arg-type]
    server.start()
    try:
        yield server
    finally:
        server.end()


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
def flooded(server: Server) -> Iterator[None]:
    """Send requests to the server at ``PER_SECOND`` while the context lasts."""
    stop = threading.Event()

    def flood() -> None:
        while not stop.is_set():
            with contextlib.suppress(OSError, WebSocketException, TimeoutError):
                _flood(server, stop)
            stop.wait(0.05)

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(10)


def _flood(server: Server, stop: threading.Event) -> None:
    """Send requests on one connection until it ends."""
    address, origin = f"ws://127.0.0.1:{server.port}/live?robot=001", Origin(server.url.rstrip("/"))
    with connect(address, origin=origin, open_timeout=5) as viewer:
        began, sent = time.monotonic(), 0
        while not stop.is_set():
            viewer.socket.sendall(FREE * BATCH)
            sent += BATCH
            time.sleep(max(0.0, began + sent / PER_SECOND - time.monotonic()))


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
