"""The exporter as a process, scraped over HTTP."""

import contextlib
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

from prometheus_client.parser import text_string_to_metric_families

from tests.metrics.robots import Values, flat
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S, wait_until


def scraped(port: int) -> Values:
    """Scrape with the parser of Prometheus' client."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
        text = answer.read().decode()
    return flat(list(text_string_to_metric_families(text)))


def value(port: int, name: str, /, **labels: str) -> float | None:
    """Return a sample's value, None when there is no such sample."""
    return scraped(port).get((name, frozenset(labels.items())))


@contextlib.contextmanager
def running(endpoint: str, folder: Path, *sets: str) -> Iterator[int]:
    """Run the exporter as a process while the context lasts; yield its port."""
    port = free_port()
    given = (f"bus.connect={endpoint}", f"metrics.port={port}", *sets)
    command = [sys.executable, "-m", "cli", "metrics"]
    command += [word for text in given for word in ("--set", text)]
    with (
        (folder / "metrics.log").open("wb") as log,
        subprocess.Popen(command, stdout=log, stderr=log) as process,
    ):
        try:
            wait_until(lambda: answers(process, port, folder), "the page", 2 * PATIENCE_S)
            yield port
            process.terminate()
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()


def answers(process: "subprocess.Popen[bytes]", port: int, folder: Path) -> bool:
    assert process.poll() is None, (folder / "metrics.log").read_text()
    with contextlib.suppress(OSError):
        return value(port, "t2_bus_connected") == 1
    return False
