"""The dashboard as a process of its own, and a viewer without a browser."""

import contextlib
import json
import ssl
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from verification.harness.support import PATIENCE_S, free_port, wait_until


@dataclass
class Site:
    """A running dashboard."""

    command: list[str]
    port: int
    log: Path
    process: "subprocess.Popen[bytes]"
    tls: ssl.SSLContext | None = None

    @property
    def url(self) -> str:
        return f"{'https' if self.tls else 'http'}://127.0.0.1:{self.port}/"

    def start(self) -> None:
        """Start it, and wait until it serves."""
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(self.command, stdout=output, stderr=output)
        wait_until(self.serves, f"the page; {self.log}", 2 * PATIENCE_S)

    def serves(self) -> bool:
        assert self.process.poll() is None, self.log.read_text()
        try:
            with urllib.request.urlopen(self.url, timeout=5, context=self.tls) as answer:
                return bool(answer.status == 200)
        except urllib.error.HTTPError as error:
            return error.code == 401  # it asks for a token
        except OSError:
            return False

    def end(self) -> None:
        """End it as an operator does; whatever hangs is killed."""
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
) -> Iterator[Site]:
    """Run a dashboard on a free port while the context lasts."""
    port = free_port()
    given = [f"bus.connect={endpoint}", f"dashboard.port={port}", "log.format=json", *sets]
    words = [word for one in given for word in ("--set", one)]
    command = [sys.executable, "-m", "services.dashboard", *words]
    site = Site(command, port, folder / "dashboard.log", None, tls)  # type: ignore[arg-type]
    site.start()
    try:
        yield site
    finally:
        site.end()


class Eye:
    """A viewer: the newest word of each kind that it was sent."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.seen: dict[str, Any] = {}

    def say(self, k: str, **fields: object) -> None:
        self.socket.send(json.dumps({"k": k, **fields}))

    def look(self) -> dict[str, Any]:
        """Wait for the next picture."""
        while True:
            word = json.loads(self.socket.recv(timeout=PATIENCE_S))
            self.seen[word["k"]] = word
            if word["k"] == "fast":
                return dict(word)

    def waits(self, kind: str) -> Any:
        """Wait for a word of this kind that has not been seen yet."""
        self.seen.pop(kind, None)
        while kind not in self.seen:
            self.look()
        return self.seen[kind]

    def takes(self, force: bool = False) -> None:
        """Take the wheel, and wait until it is ours."""
        self.say("take", force=force)
        while self.look()["driver"]["id"] != self.seen["hello"]["id"]:
            pass


@contextlib.contextmanager
def eye(site: Site, robot: str = "001") -> Iterator[Eye]:
    """Look at a robot while the context lasts."""
    address = f"ws://127.0.0.1:{site.port}/live"
    with connect(address, origin=Origin(site.url.rstrip("/"))) as socket:
        it = Eye(socket)
        it.say("look", robot=robot)
        it.waits("hello")
        yield it
