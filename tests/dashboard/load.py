"""``python -m tests.dashboard.load PORT PID``: CPU load of the dashboard's process by viewers.

Connects ten viewers, waits, and prints the rate of snapshots per viewer and the CPU time of the
process as a share of a core.
"""

import os
import sys
import threading
import time
from pathlib import Path

from websockets.sync.client import connect
from websockets.typing import Origin

VIEWERS = 10
SECONDS = 20.0


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has used, in seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def watch(port: str, counts: list[int], index: int) -> None:
    """Count the snapshots of one viewer."""
    origin = Origin(f"http://127.0.0.1:{port}")
    with connect(f"ws://127.0.0.1:{port}/live", origin=origin) as socket:
        socket.send('{"k":"look","robot":"001"}')
        for text in socket:
            counts[index] += '"fast"' in str(text)[:12]


def main() -> None:
    """Run the measurement."""
    port, pid = sys.argv[1], int(sys.argv[2])
    counts = [0] * VIEWERS
    for index in range(VIEWERS):
        threading.Thread(target=watch, args=(port, counts, index), daemon=True).start()
    time.sleep(3.0)
    counted, began_s, used_s = list(counts), time.monotonic(), cpu_s(pid)
    time.sleep(SECONDS)
    past_s = time.monotonic() - began_s
    rates = [(after - before) / past_s for after, before in zip(counts, counted, strict=True)]
    share = (cpu_s(pid) - used_s) / past_s
    print(f"{VIEWERS} viewers, {min(rates):.1f} to {max(rates):.1f} snapshots/s each: ", end="")  # noqa: T201
    print(f"{100 * share:.1f} % of a core")  # noqa: T201


if __name__ == "__main__":
    main()
