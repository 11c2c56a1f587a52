"""CPU time and memory of processes, and bytes on their connections.

Read from ``/proc`` and from ``ss`` of iproute2.
"""

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from verification.harness.process_stats import stat, tree

FIELDS = {
    "up": r"bytes_sent:(\d+)", "down": r"bytes_received:(\d+)",
    "up_segments": r"segs_out:(\d+)", "down_segments": r"segs_in:(\d+)",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Usage:
    """Resources that processes have used since their start."""

    cpu_s: float
    rss: int  # bytes, now


def usage(pids: Sequence[int]) -> Usage:
    """Return the usage of these processes and all their descendants."""
    found = [stat(pid) for root in pids for _, pid in tree("", root)]
    return Usage(sum(each.cpu_s for each in found), sum(each.rss for each in found))


def connections(port: int) -> dict[int, dict[str, int]]:
    """Return for each client process of this port the bytes sent (``up``) and received."""
    done = subprocess.run(
        ["ss", "-tinpHO", f"dport = :{port}"], capture_output=True, text=True, check=True
    )
    return parsed(done.stdout)


def parsed(text: str) -> dict[int, dict[str, int]]:
    """Parse the output of ``ss``, one line for each connection; sum them for each process."""
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
