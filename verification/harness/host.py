"""The host of a measurement: its description, and a recorder of its scheduling stalls."""

import os
import platform
import subprocess
import sys
import threading
from pathlib import Path
from typing import Self

from common.freshness import NS_PER_S

PERIOD_S = 0.002  # that the recording process sleeps
SLEEPER = """
import time
last = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
while True:
    time.sleep(0.002)
    now = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    if now - last > 4_000_000:
        print(last, now, flush=True)
    last = now
"""


def description() -> str:
    """Return CPU model, number of cores and kernel."""
    model = next(
        (line.partition(":")[2].strip()
         for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
         if line.startswith("model name")),
        platform.processor(),
    )  # fmt: skip
    return f"{model}, {os.cpu_count()} cores, Linux {platform.release()}"


class StallRecorder:
    """Records how long the host keeps a process that only sleeps from running.

    A deadline that is missed by no more than a stall is the host's fault, not the program's. The
    sleeper is a separate process: a thread would also wait for this interpreter's lock.
    """

    def __init__(self) -> None:
        self._gaps: list[tuple[int, int]] = []
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-c", SLEEPER], stdout=subprocess.PIPE, text=True
        )
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> float:
        """Stop recording; return the longest stall, in seconds."""
        self._process.kill()
        self._process.wait()
        self._thread.join()
        assert self._process.stdout is not None
        self._process.stdout.close()
        longest_ns = max((b - a for a, b in self._gaps), default=0)
        return max(0.0, longest_ns / NS_PER_S - PERIOD_S)

    def worst_s(self, since_ns: int, seconds: float) -> float:
        """Return the longest stall that overlaps this period, in seconds."""
        until_ns = since_ns + round(seconds * NS_PER_S)
        return max(
            ((b - a) / NS_PER_S for a, b in list(self._gaps) if b > since_ns and a < until_ns),
            default=0.0,
        )

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            first, last = map(int, line.split())
            self._gaps.append((first, last))
