"""A program as an operator runs it: the real one, teleop unless named, in a pseudo terminal."""

import contextlib
import fcntl
import os
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator

TELEOP = ("services.teleop", "--no-gamepad")


class Terminal:
    """A pseudo terminal with a program in it: its module and arguments."""

    def __init__(self, endpoint: str, *program: str) -> None:
        self.fd, inner = os.openpty()
        fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-m", *program),
                *("--set", f"bus.connect={endpoint}"),
            ],
            stdin=inner,
            stdout=inner,
            stderr=inner,
            env=os.environ | {"TERM": "xterm-256color"},
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
    it = Terminal(endpoint, *(program or TELEOP))
    try:
        yield it
    finally:
        it.process.kill()
        it.process.wait()
        it.hang_up()
