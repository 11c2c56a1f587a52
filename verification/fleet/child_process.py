"""A process that takes part: it says when it is ready, and tells what was between two moments."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

PATIENCE_S = 60.0


class Part:
    """Its starter's end."""

    def __init__(self, *words: str) -> None:
        command = [sys.executable, "-m", *words]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.hear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.process.communicate(timeout=PATIENCE_S)
        finally:
            self.process.kill()
            self.process.wait()

    @property
    def pid(self) -> int:
        return self.process.pid

    def begin(self) -> None:
        """Let it count from now on."""
        self._say("begin")

    def end(self) -> Any:
        """Return what it has counted."""
        self._say("end")
        return json.loads(self.hear())

    def hear(self) -> str:
        """Return its next line."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, f"{self.process.args!r} has ended"
        return line

    def _say(self, word: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{word}\n")
        self.process.stdin.flush()


def obey(begin: Callable[[], None], end: Callable[[], object], leave: Callable[[], None]) -> None:
    """Be such a process, in a thread beside what it does."""

    def listen() -> None:
        for line in sys.stdin:
            if line.strip() == "begin":
                begin()
            else:
                tell(end())
        leave()

    threading.Thread(target=listen, daemon=True).start()
    tell("ready")


def tell(what: object) -> None:
    """Write a line to whoever started this process."""
    print(json.dumps(what), flush=True)
