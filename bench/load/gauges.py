"""What the system tells of processes and a socket, read from ``/proc``."""

import contextlib
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Self

from common.freshness import NS_PER_S
from verification.fleet.gauges import TICKS, machine
from verification.soak.process_stats import GONE

PROC = Path("/proc")


class Shares:
    """What processes take of a core while the context lasts, user and system, of all threads.

    ``ns`` has it in nanoseconds a second, but of who has ended meanwhile; ``machine`` is of all
    cores, whoever has it.
    """

    def __init__(self, pids: Mapping[str, int]) -> None:
        self.ns: dict[str, int] = {}
        self._pids = pids

    def __enter__(self) -> Self:
        self._was, self._since_s = self._read(), time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        past_s = time.monotonic() - self._since_s
        after = self._read()
        self.ns = {
            name: round((now - self._was[name]) * NS_PER_S / past_s) for name, now in after.items()
        }

    def _read(self) -> dict[str, float]:
        found = {"machine": machine().busy_s}
        for name, pid in self._pids.items():
            with contextlib.suppress(*GONE):
                found[name] = cpu_s(pid)
        return found


def cpu_s(pid: int) -> float:
    """Return the time of a core that a process has had."""
    fields = (PROC / str(pid) / "stat").read_text(encoding="ascii", errors="replace")
    rest = fields.rpartition(")")[2].split()  # from field 3 of proc(5) on
    return (int(rest[11]) + int(rest[12])) / TICKS


def memory(pid: int) -> dict[str, int]:
    """Return a process's resident bytes: ``rss``, and ``pss``, where shared pages are divided."""
    text = (PROC / str(pid) / "smaps_rollup").read_text(encoding="ascii")
    found = re.findall(r"^(Rss|Pss): +(\d+)", text, re.MULTILINE)
    return {name.lower(): 1024 * int(kb) for name, kb in found}


def drops(port: int) -> int:
    """Return how many datagrams the kernel had no room for, at a UDP port of this host."""
    for line in (PROC / "net" / "udp").read_text(encoding="ascii").splitlines()[1:]:
        fields = line.split()
        if int(fields[1].rpartition(":")[2], 16) == port:
            return int(fields[-1])
    raise LookupError(f"nobody has UDP port {port}")
