"""Whether this process may ask for SCHED_FIFO."""

import subprocess
import sys
from functools import cache

import pytest

from common.realtime import BOARD

PATIENCE_S = 60

PRELUDE = "from common import realtime as r; import os, threading, resource; "


def output_of(script: str) -> list[str]:
    """Run a script in an ordinary process; return its words."""
    command = [sys.executable, "-c", PRELUDE + script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    return done.stdout.split()


@cache
def granted() -> bool:
    return output_of("r.request(r.BOARD); print(r.priority())") == [str(BOARD)]


needs_right = pytest.mark.skipif(
    not granted(), reason="needs the right to SCHED_FIFO: root, or `ulimit -r 55`"
)
