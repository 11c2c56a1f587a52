"""Child processes: safe import path and restart backoff.

``common`` and ``services`` are generic names (docs/decisions.md#import-names). A folder of that
name in the working directory, or on PYTHONPATH as in every ROS workspace, must not shadow ours.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]  # the folder of our packages; in a checkout sdk has one
PATHS = [str(folder) for folder in (ROOT, ROOT / "sdk") if folder.exists()]
VARIABLE = "PYTHONPATH"

BACKOFF_S = (0.0, 0.5, 1.0, 2.0, 5.0)  # delay before each restart; the last value repeats
CALM_S = 10.0  # a longer run resets the delay


def command(module: str, *words: str) -> list[str]:
    """Return the command that runs one of our modules; start it with ``environ``."""
    return [sys.executable, "-P", "-m", module, *words]  # -P: working directory not on sys.path


def environ() -> dict[str, str]:
    """Return this process' environment with our packages first in PYTHONPATH."""
    others = os.environ.get(VARIABLE, "").split(os.pathsep)
    paths = [*PATHS, *(path for path in others if path and path not in PATHS)]
    return os.environ | {VARIABLE: os.pathsep.join(paths)}


class Backoff:
    """Restart delays of one process."""

    def __init__(self) -> None:
        self._restarts = 0

    def after(self, lived_s: float) -> float:
        """Return the delay in seconds, after a run of ``lived_s``."""
        if lived_s > CALM_S:
            self._restarts = 0
        wait_s = BACKOFF_S[min(self._restarts, len(BACKOFF_S) - 1)]
        self._restarts += 1
        return wait_s
