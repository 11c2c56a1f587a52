"""What the system tells of processes and files: memory, threads, descriptors, lines written.

Read from ``/proc``, as Linux has it.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from verification.soak.record import Life, Sample

PROC = Path("/proc")
PAGE = os.sysconf("SC_PAGE_SIZE")
GONE = (FileNotFoundError, ProcessLookupError)


def tree(name: str, pid: int) -> Iterator[tuple[str, int]]:
    """Yield a process and all that it has started, ``bridge``, ``bridge/1``, with their pids."""
    yield name, pid
    for number, child in enumerate(_children(pid), 1):
        yield from tree(f"{name}/{number}", child)


def look(name: str, pid: int, at_s: float) -> tuple[Life, Sample] | None:
    """Return how a process fares; None when it is gone."""
    try:
        fields = (PROC / str(pid) / "stat").read_text(encoding="ascii", errors="replace")
        descriptors = sum(1 for _ in (PROC / str(pid) / "fd").iterdir())
    except GONE:
        return None
    rest = fields.rpartition(")")[2].split()  # from field 3 of proc(5) on
    if rest[0] in "ZX":
        return None
    life = Life(name, pid, started=int(rest[19]))
    return life, Sample(at_s, int(rest[21]) * PAGE, int(rest[17]), descriptors)


def _children(pid: int) -> list[int]:
    # A child belongs to the thread that started it.
    found: list[int] = []
    with contextlib.suppress(*GONE):
        for task in sorted((PROC / str(pid) / "task").iterdir()):
            with contextlib.suppress(*GONE):
                found += map(int, (task / "children").read_text(encoding="ascii").split())
    return found


class Tail:
    """Reads a growing file, whole lines at a time; one that was begun anew, from its start."""

    def __init__(self, file: Path) -> None:
        self.bytes = 0  # read so far
        self._file = file

    def read(self) -> bytes:
        """Return the lines that have come since the last call; a half one waits."""
        try:
            with self._file.open("rb") as file:
                if os.fstat(file.fileno()).st_size < self.bytes:
                    self.bytes = 0
                file.seek(self.bytes)
                new = file.read()
        except FileNotFoundError:
            return b""
        whole = new[: new.rfind(b"\n") + 1]
        self.bytes += len(whole)
        return whole
