"""A program in a pseudo terminal with a simulated delay; teleop by default."""

import contextlib
import fcntl
import os
import re
import select
import struct
import subprocess
import sys
import termios
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

# A host that runs tests stalls terminals for longer than a vehicle may accept.
PATIENT = (
    "--set", "unsafe_overrides=teleop.round_trip", "--set", "teleop.round_trip=2.0",
)  # fmt: skip
STRICT = ("services.teleop", "--no-gamepad")
TELEOP = (*STRICT, *PATIENT)

# Teleop's query of the cursor position.
QUERY = re.compile(rb"\x1b\[(\d+);(\d+)H\x1b\[6n")
POLL_S = 0.005
MULTIPLEXERS = ("TMUX", "STY", "ZELLIJ")  # of the test's terminal; not in teleop's environment


class DelayLine:
    """One direction of the connection to a terminal: first in, first out, after a delay."""

    def __init__(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self.held_until = 0.0
        self._parts: deque[tuple[float, bytes]] = deque()

    def put(self, part: bytes) -> None:
        self._parts.append((time.monotonic() + self.delay_s, part))

    def take(self) -> bytes:
        """Return the bytes that have arrived."""
        now, arrived = time.monotonic(), b""
        while self._parts and max(self._parts[0][0], self.held_until) <= now:
            arrived += self._parts.popleft()[1]
        return arrived


class Terminal:
    """A pseudo terminal with a program and an emulator that answers its queries after a delay."""

    def __init__(
        self,
        command: Sequence[str],
        folder: Path | None = None,
        env: Mapping[str, str] = os.environ,
        *,
        delay_s: float = 0.0,
    ) -> None:
        self.fd, inner = os.openpty()
        fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        usual = {name: value for name, value in env.items() if name not in MULTIPLEXERS}
        self.process = subprocess.Popen(
            command,
            stdin=inner,
            stdout=inner,
            stderr=inner,
            cwd=folder,
            env={**usual, "TERM": "xterm-256color"},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(inner)
        os.set_blocking(self.fd, False)
        self.shown = b""
        self._keys, self._output = DelayLine(delay_s), DelayLine(delay_s)
        self._seen = 0  # bytes of ``shown`` that were searched for queries
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def type(self, keys_: str) -> None:
        self._keys.put(keys_.encode())

    def stall(self, seconds: float) -> None:
        """Delay both directions; then deliver everything at once."""
        self._keys.held_until = self._output.held_until = time.monotonic() + seconds

    def read(self) -> None:
        """Wait until all output and keys are delivered, if there is no delay."""
        time.sleep(2 * POLL_S)

    def shows(self, text: bytes) -> bool:
        """Return whether this text was drawn."""
        return text in self.shown

    def hang_up(self) -> None:
        if self.fd >= 0:
            self._closed.set()
            self._thread.join()
            os.close(self.fd)
            self.fd = -1

    def ends(self) -> bool:
        """Return whether the program has ended."""
        return self.process.poll() is not None

    def _serve(self) -> None:
        """Read continuously: otherwise the program stalls."""
        while not self._closed.is_set():
            with contextlib.suppress(OSError):  # the program has ended
                if select.select([self.fd], [], [], POLL_S)[0]:
                    self._output.put(os.read(self.fd, 65536))
            self._draw(self._output.take())
            with contextlib.suppress(OSError):
                if typed := self._keys.take():
                    os.write(self.fd, typed)
            if self.process.poll() is not None:
                time.sleep(POLL_S)  # select returns immediately from now on

    def _draw(self, part: bytes) -> None:
        self.shown += part
        for query in QUERY.finditer(self.shown, self._seen):
            self._seen = query.end()
            row, column = query.groups()
            self._keys.put(b"\x1b[%s;%sR" % (row, column))


@contextlib.contextmanager
def terminal(endpoint: str, *program: str, delay_s: float = 0.0) -> Iterator[Terminal]:
    """Run a module with its arguments in a terminal while the context lasts."""
    module = [sys.executable, "-m", *(program or TELEOP), "--set", f"bus.connect={endpoint}"]
    with at_terminal(Terminal(module, delay_s=delay_s)) as it:
        yield it


@contextlib.contextmanager
def at_terminal(it: Terminal) -> Iterator[Terminal]:
    """Kill the program in a terminal at the end of the context."""
    try:
        yield it
    finally:
        it.process.kill()
        it.process.wait()
        it.hang_up()
