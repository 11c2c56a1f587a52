"""The checkout as a process, answered through a pipe."""

import contextlib
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.cli.processes import t2
from verification.harness.waiting import wait_until

PATIENCE_S = 60.0


class OperatorProcess:
    """Process of the checkout; ``wait`` reads its output from the last match on."""

    def __init__(self, words: Sequence[str]) -> None:
        self.process = subprocess.Popen(
            t2("checkout", *words),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,
        )
        self.shown = ""
        self._read = 0
        self._thread = threading.Thread(target=self._take, daemon=True)
        self._thread.start()

    def wait(self, *words: str) -> str:
        """Wait for one of these texts and return it; the output up to it counts as read."""

        def found() -> bool:
            assert self.process.poll() is None or any(w in self._news() for w in words), self.shown
            return any(word in self._news() for word in words)

        try:
            wait_until(found, f"one of {words}", PATIENCE_S)
        except AssertionError as error:
            raise AssertionError(f"{error}; its output:\n{self.shown}") from None
        news = self._news()
        first = min((w for w in words if w in news), key=news.index)
        self._read += news.index(first) + len(first)
        return first

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def begin(self, name: str = "Ada") -> None:
        """Answer the questions before the first step."""
        self.wait("Your name:")
        self.type(name)
        self.wait("The firmware")
        self.type("")

    def sign(self, name: str = "Ada") -> int:
        """Sign, and return the exit code."""
        self.wait("To sign this off")
        self.type(name)
        return self.end()

    def end(self) -> int:
        """Wait for the end, and return the exit code."""
        code = self.process.wait(PATIENCE_S)
        self._thread.join(PATIENCE_S)
        return code

    def kill(self) -> None:
        """Kill it, in any state."""
        self.process.kill()
        self.process.wait()
        self._thread.join(PATIENCE_S)
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()

    def _news(self) -> str:
        return self.shown[self._read :]

    def _take(self) -> None:
        assert self.process.stdout is not None
        while part := self.process.stdout.read(4096):
            self.shown += part.decode()


@contextlib.contextmanager
def checkout(report: Path, *words: str) -> Iterator[OperatorProcess]:
    it = OperatorProcess(["--report", str(report), *words])
    try:
        yield it
    finally:
        it.kill()
