"""What the system tells of processes and connections: CPU time, memory, bytes on the wire.

Read from ``/proc`` and from ``ss`` of iproute2, as Linux has them.
"""

import os
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from verification.soak.process_stats import tree

PROC = Path("/proc")
TICKS = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")
FIELDS = {
    "up": r"bytes_sent:(\d+)", "down": r"bytes_received:(\d+)",
    "up_segments": r"segs_out:(\d+)", "down_segments": r"segs_in:(\d+)",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Used:
    """What processes have taken since their start."""

    cpu_s: float
    rss: int  # bytes, now


@dataclass(frozen=True, slots=True)
class Machine:
    """Where the time of all cores went, since boot."""

    busy_s: float
    idle_s: float
    stolen_s: float  # another machine on the same host had it


def used(pids: Sequence[int]) -> Used:
    """Return what these processes and all that they have started use."""
    cpu_s, rss = 0.0, 0
    for root in pids:
        for _, pid in tree("", root):
            fields = (PROC / str(pid) / "stat").read_text(encoding="ascii", errors="replace")
            rest = fields.rpartition(")")[2].split()  # from field 3 of proc(5) on
            cpu_s += (int(rest[11]) + int(rest[12])) / TICKS
            rss += int(rest[21]) * PAGE
    return Used(cpu_s, rss)


def machine() -> Machine:
    """Return the machine's."""
    line = (PROC / "stat").read_text(encoding="ascii").splitlines()[0]
    user, nice, system, idle, wait, irq, soft, steal = (int(n) / TICKS for n in line.split()[1:9])
    return Machine(user + nice + system + irq + soft, idle + wait, steal)


def links(port: int) -> dict[int, dict[str, int]]:
    """Return what each process that dials this port has sent (``up``) and received, in bytes."""
    said = subprocess.run(
        ["ss", "-tinpHO", f"dport = :{port}"], capture_output=True, text=True, check=True
    )
    return parsed(said.stdout)


def parsed(text: str) -> dict[int, dict[str, int]]:
    """Read the lines of ``ss``, one for each connection; a process may have many."""
    found: dict[int, dict[str, int]] = {}
    for line in text.splitlines():
        owner = re.search(r"pid=(\d+)", line)
        if owner:
            sums = found.setdefault(int(owner[1]), dict.fromkeys(FIELDS, 0))
            for name, pattern in FIELDS.items():
                count = re.search(pattern, line)
                sums[name] += int(count[1]) if count else 0
    return found


def since(after: Mapping[str, int], before: Mapping[str, int], seconds: float) -> dict[str, float]:
    """Return counts per second."""
    return {name: (after[name] - before.get(name, 0)) / seconds for name in after}
