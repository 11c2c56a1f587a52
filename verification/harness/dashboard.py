"""The dashboard as a separate process, and a flood of requests to it."""

import contextlib
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

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
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
