"""A child process that counts between ``begin`` and ``end``, controlled by its standard streams.

The child prints ``"ready"`` as JSON. On ``begin`` it resets its counts, on ``end`` it prints them
as JSON; it executes other lines. It ends with its standard input.
"""

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, Self

PATIENCE_S = 60.0


class ChildProcess:
    """The parent's side; the module runs as long as the context."""

    def __init__(self, *words: str) -> None:
        command = [sys.executable, "-m", *words]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._read_line()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.process.communicate(timeout=PATIENCE_S)
        finally:
            self.process.kill()
            self.process.wait()

    def end(self) -> Any:
        """Return the counts since ``begin``."""
        self.send("end")
        return json.loads(self._read_line())

    def _read_line(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, f"{self.process.args!r} has ended"
        return line

    def send(self, line: str) -> None:
        """Send a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()


def serve(
    begin: Callable[[], None],
    end: Callable[[], object],
    leave: Callable[[], None],
    execute: Callable[[str], object] = lambda _: None,
) -> None:
    """Serve the parent in a thread; ``leave`` is called when standard input ends."""

    def read_commands() -> None:
        for word in map(str.strip, sys.stdin):
            if word == "begin":
                begin()
            elif word == "end":
                _write(end())
            else:
                execute(word)
        leave()

    threading.Thread(target=read_commands, daemon=True).start()
    _write("ready")


def _write(what: object) -> None:
    sys.stdout.write(f"{json.dumps(what)}\n")
    sys.stdout.flush()
