"""A program as an operator runs it, in a pseudo terminal; teleop unless another is named."""

import contextlib
import fcntl
import os
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

TELEOP = ("services.teleop", "--no-gamepad")


class Terminal:
    """A pseudo terminal with a program in it."""

    def __init__(
        self,
        command: Sequence[str],
        folder: Path | None = None,
        env: Mapping[str, str] = os.environ,
    ) -> None:
        self.fd, inner = os.openpty()
        fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.process = subprocess.Popen(
            command,
            stdin=inner,
            stdout=inner,
            stderr=inner,
            cwd=folder,
            env={**env, "TERM": "xterm-256color"},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(inner)
        os.set_blocking(self.fd, False)
        self.shown = b""

    def type(self, keys_: str) -> None:
        os.write(self.fd, keys_.encode())

    def read(self) -> None:
        """Take what was drawn since the last look; the program stalls if nobody does."""
        with contextlib.suppress(OSError):
            while part := os.read(self.fd, 65536):
                self.shown += part

    def reading(self) -> bool:
        """Read on beside another condition; always true."""
        self.read()
        return True

    def shows(self, words: bytes) -> bool:
        """Tell whether the words have been drawn."""
        self.read()
        return words in self.shown

    def hang_up(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1

    def ends(self) -> bool:
        """Tell whether the program has ended."""
        self.read()
        return self.process.poll() is not None


@contextlib.contextmanager
def terminal(endpoint: str, *program: str) -> Iterator[Terminal]:
    """Run a module with its arguments on the bus at an endpoint while the context lasts."""
    module = [sys.executable, "-m", *(program or TELEOP)]
    with at_terminal(Terminal([*module, "--set", f"bus.connect={endpoint}"])) as it:
        yield it


@contextlib.contextmanager
def at_terminal(it: Terminal) -> Iterator[Terminal]:
    """End what runs in a terminal with the context."""
    try:
        yield it
    finally:
        it.process.kill()
        it.process.wait()
        it.hang_up()
