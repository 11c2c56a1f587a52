"""A short soak."""

import subprocess
import sys
from pathlib import Path

import pytest

PROCESSES = "router", "sim", "bridge", "bridge/1", "safety", "odom", "driver"


@pytest.mark.timed
@pytest.mark.campaign
@pytest.mark.timeout(200)
def test_a_short_soak(tmp_path: Path) -> None:
    """A minute is too short to measure growth: only that result may be wrong."""
    command = [sys.executable, "-m", "verification.soak", "--minutes", "0.8", "--seed", "22"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path)], capture_output=True, text=True, timeout=180, check=False
    )
    rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")]
    bad = [what for what, _, mark in rows if mark.startswith("WRONG")]
    assert all("memory" in what or "threads" in what for what in bad), done.stdout
    assert done.returncode == bool(bad), done.stderr
    assert {f"| {name}: memory" for name in PROCESSES} <= {what for what, *_ in rows}
