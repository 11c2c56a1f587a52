"""Which machine it is, and how long it holds up a process that only wants to sleep, and when."""

import os
import platform
import subprocess
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

from common.freshness import NS_PER_S

WITNESS = """
import sys, time
last = time.monotonic_ns()
while True:
    time.sleep(0.002)
    now = time.monotonic_ns()
    if now - last > 4_000_000:
        print(last, now, flush=True)
    last = now
"""


def named() -> str:
    """Return processor, cores and kernel."""
    model = next(
        (line.partition(":")[2].strip()
         for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
         if line.startswith("model name")),
        platform.processor(),
    )  # fmt: skip
    return f"{model}, {os.cpu_count()} cores, Linux {platform.release()}"


class HoldUps:
    """A witness beside the campaign, in a process of its own."""

    def __init__(self) -> None:
        self._gaps: list[tuple[int, int]] = []

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-c", WITNESS], stdout=subprocess.PIPE, text=True
        )
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._process.kill()
        self._process.wait()
        self._thread.join()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def worst_s(self, since_ns: int, seconds: float) -> float:
        """Return the longest hold-up that touches this time, in seconds."""
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
