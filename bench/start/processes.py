"""Processes of Python that are started, and ended with all that they have started."""

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

from bench.path.processes import robots_python

UNKEPT = "PYTHONDONTWRITEBYTECODE"


@contextlib.contextmanager
def started(*words: str) -> Iterator[tuple["subprocess.Popen[bytes]", int]]:
    """Yield a new Python and the time of its start; kill it and its children in the end."""
    # Byte code is kept, as in every installation, whatever the one who measures does himself.
    environ = {name: text for name, text in os.environ.items() if name != UNKEPT}
    begin_ns = time.monotonic_ns()
    process = subprocess.Popen([robots_python(), *words], env=environ, stderr=subprocess.DEVNULL)
    try:
        yield process, begin_ns
    finally:
        for pid in (process.pid, *children(process.pid)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()


def children(pid: int) -> list[int]:
    """Return the processes that one has started and that live."""
    file = Path(f"/proc/{pid}/task/{pid}/children")
    try:
        return [int(word) for word in file.read_text(encoding="ascii").split()]
    except FileNotFoundError:
        return []


def settings(*given: str) -> list[str]:
    """Return them as options of a command."""
    return [word for each in given for word in ("--set", each)]
