"""The replay in a process of its own, which nothing from outside gets into."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
Counts = dict[str, float]


def replayed(what: str, *before: str) -> Counts:
    """Return what ``verification.cost.replay`` prints; ``before`` are the words of what runs it."""
    environ = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0"}
    command = [*before, sys.executable, "-m", "verification.cost.replay", what]
    done = subprocess.run(
        command, cwd=ROOT, env=environ, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"the replay failed: {done.stderr}"
    counts: Counts = json.loads(done.stdout.splitlines()[-1])
    return counts
