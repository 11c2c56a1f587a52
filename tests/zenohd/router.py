"""A real ``zenohd`` as the stack's router, and a second one with the REST plugin."""

import contextlib
import json
import os
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.cli.processes import ran, sets
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

REST = Path(__file__).parent.parent.parent / "deploy" / "zenohd" / "rest.json5"
ABSENT = "zenohd not found, neither by ZENOHD nor on PATH; see deploy/zenohd/README.md"


def found() -> str:
    """Return the path of zenohd; skip the test when it is not installed."""
    path = os.environ.get("ZENOHD") or shutil.which("zenohd")
    if not path:
        pytest.skip(ABSENT)
    return path


def command(zenohd: str, folder: Path, given: Sequence[str]) -> list[str]:
    """Return the command of zenohd with the configuration from ``t2 router --print``."""
    printed = ran("router", "--print", *sets(*given))
    assert printed.returncode == 0, printed.stderr
    file = folder / "zenohd.json5"
    file.write_text(printed.stdout, encoding="utf-8")
    return [zenohd, "-c", str(file)]


@dataclass(frozen=True)
class Rest:
    """The REST interface."""

    port: int

    def get(self, path: str, accept: str = "application/json") -> bytes:
        """GET a key; raise unless the status is 200."""
        return self._request(path, "GET", accept=accept)

    def rows(self, path: str) -> list[dict[str, Any]]:
        """GET a key, and return all replies."""
        rows: list[dict[str, Any]] = json.loads(self.get(path))
        return rows

    def follow(self, path: str) -> Iterator[bytes]:
        """Yield each sample from now on, as JSON."""
        url = f"http://127.0.0.1:{self.port}/{path}"
        request = urllib.request.Request(url, headers={"Accept": "text/event-stream"})
        with urllib.request.urlopen(request, timeout=60) as answer:
            for line in answer:
                if line.startswith(b"data:"):
                    yield line.removeprefix(b"data:")

    def put(self, path: str, body: bytes) -> None:
        """Publish like `curl -X PUT`."""
        self._request(path, "PUT", body)

    def _request(
        self, path: str, method: str, body: bytes | None = None, accept: str = ""
    ) -> bytes:
        url = f"http://127.0.0.1:{self.port}/{path}"
        request = urllib.request.Request(url, body, {"Accept": accept}, method=method)
        with urllib.request.urlopen(request, timeout=15) as answer:
            return bytes(answer.read())

    def answers(self) -> bool:
        """Return whether it listens."""
        with contextlib.suppress(OSError):
            self.get("t2/nothing")
            return True
        return False


@contextlib.contextmanager
def rest(
    zenohd: str, log: Path, endpoint: str, tls: dict[str, object] | None = None
) -> Iterator[Rest]:
    """Run zenohd with REST; skip when its plugins are not installed."""
    port = free_port()
    changes = {"plugins/rest/http_port": f"127.0.0.1:{port}", "connect/endpoints": [endpoint]}
    if tls is not None:
        changes["transport/link/tls"] = tls  # type: ignore[assignment]
    words = [f"--cfg={path}:{json.dumps(value)}" for path, value in changes.items()]
    started = [zenohd, "-c", str(REST), *words]
    with (
        log.open("ab") as output,
        subprocess.Popen(started, stdout=output, stderr=output) as process,
    ):
        try:
            it = Rest(port)
            wait_until(lambda: process.poll() is not None or it.answers(), f"REST; {log}")
            text = log.read_text(encoding="utf-8", errors="replace")
            if process.poll() is not None and "library not found" in text.lower():
                pytest.skip("this zenohd has no plugins for REST and storages")
            assert process.poll() is None, text
            yield it
        finally:
            process.kill()
