"""CPU time, memory and children of processes, from ``/proc`` of Linux."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")
PAGE = os.sysconf("SC_PAGE_SIZE")
TICKS = os.sysconf("SC_CLK_TCK")
GONE = (FileNotFoundError, ProcessLookupError)


@dataclass(frozen=True, slots=True)
class Stat:
    """Fields of ``/proc/PID/stat``, see proc(5)."""

    state: str
    cpu_s: float  # user and system, all threads
    threads: int
    rss: int  # bytes


def stat(pid: int) -> Stat:
    """Return the state of a process; raise one of ``GONE`` when it does not exist."""
    text = (PROC / str(pid) / "stat").read_text(encoding="ascii", errors="replace")
    rest = text.rpartition(")")[2].split()  # from field 3 of proc(5) on
    cpu_s = (int(rest[11]) + int(rest[12])) / TICKS
    return Stat(rest[0], cpu_s, int(rest[17]), int(rest[21]) * PAGE)


def main_thread_s(pid: int) -> float:
    """Return the CPU time of the main thread, in s; raise one of ``GONE`` without the process."""
    text = (PROC / str(pid) / "task" / str(pid) / "schedstat").read_text(encoding="ascii")
    return int(text.split()[0]) / 1e9


def children(pid: int) -> list[int]:
    """Return the living child processes; empty when the process does not exist."""
    # A child belongs to the thread that started it.
    found: list[int] = []
    with contextlib.suppress(*GONE):
        for task in sorted((PROC / str(pid) / "task").iterdir()):
            with contextlib.suppress(*GONE):
                found += map(int, (task / "children").read_text(encoding="ascii").split())
    return found


def tree(name: str, pid: int) -> Iterator[tuple[str, int]]:
    """Yield a process and all its descendants, ``bridge``, ``bridge/1``, with their pids."""
    yield name, pid
    for number, child in enumerate(children(pid), 1):
        yield from tree(f"{name}/{number}", child)
