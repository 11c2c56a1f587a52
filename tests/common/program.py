"""A process under test, with what it writes to standard error."""

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import IO, Any

from verification.harness.waiting import PATIENCE_S, wait_until

SPECIMEN = "tests.common.example_service"


class Program:
    """Runs ``python -m`` something and keeps its lines as they come."""

    def __init__(self, *words: str, tty: bool = False) -> None:
        reader, writer = os.openpty() if tty else os.pipe()
        self.lines: list[str] = []
        self.process = subprocess.Popen([sys.executable, "-m", *words], stderr=writer)
        os.close(writer)
        self._thread = threading.Thread(
            target=self._read, args=(os.fdopen(reader, encoding="utf-8"),)
        )
        self._thread.start()

    def _read(self, stream: IO[str]) -> None:
        with stream, contextlib.suppress(OSError):  # EIO is the end of a terminal
            for line in stream:
                self.lines.append(line.rstrip())

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def wait_for(self, words: str, count: int = 1) -> None:
        """Return once that many lines have the words."""
        wait_until(
            lambda: sum(words in line for line in self.lines) >= count,
            f"{words!r} in standard error",
        )

    def events(self) -> list[str]:
        """Return what it logged, by name, when it logs JSON."""
        entries: list[dict[str, Any]] = [json.loads(line) for line in self.lines]
        return [entry["event"] for entry in entries]

    def code(self) -> int:
        """Wait for its end and return its exit code."""
        code = self.process.wait(PATIENCE_S)
        self._thread.join(PATIENCE_S)
        return code

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        self._thread.join(PATIENCE_S)


@contextlib.contextmanager
def program(*words: str, tty: bool = False) -> Iterator[Program]:
    """Run a program while the context lasts."""
    made = Program(*words, tty=tty)
    try:
        yield made
    finally:
        made.end()


def on(endpoint: str, robot: str) -> list[str]:
    """Return the options that put a service on a router."""
    return ["--set", f"bus.connect={endpoint}", "--set", f"robot.id={robot}"]
