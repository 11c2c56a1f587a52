"""Core of the roaming campaign: two hosts with different clocks, and an outage of the link."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from verification.roaming.__main__ import UNAVAILABLE

pytestmark = [pytest.mark.timed, pytest.mark.campaign]

NAMES = ("1 % lost", "down for 1 s")


def test_the_vehicle_stops_without_the_link_and_its_control_chain_continues(tmp_path: Path) -> None:
    only = [word for name in NAMES for word in ("--only", name)]
    out = tmp_path / "roaming.md"
    command = [
        sys.executable,
        "-m",
        "verification.roaming",
        "--seconds",
        "3",
        "--times",
        "1",
        *only,
    ]
    done = subprocess.run(
        [*command, "--out", str(out)], capture_output=True, text=True, timeout=110, check=False
    )
    if done.returncode == UNAVAILABLE:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    lines = out.read_text(encoding="utf-8").splitlines()
    assert any(re.match(r"\| 1 % lost \| \d+% of \d+ \|", line) for line in lines)
    assert any(re.match(r"\| down for 1 s \| 1 \| [^|]* \(1\) \|", line) for line in lines)
    assert lines[-1] == "All results are within the limits."
