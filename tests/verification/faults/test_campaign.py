"""The campaign itself, as it is run by hand: a few of the faults that need more than processes."""

import subprocess
import sys
from pathlib import Path

import pytest

from verification.faults.catalogue import FAULTS

pytestmark = [pytest.mark.timed, pytest.mark.campaign]

NAMES = (
    "driver's network cut for 0.8 s, then the burst", "robot's clock stepped by +1 h",
    "disk full, then contact", "driver out of memory", "contact in one sample",
)  # fmt: skip


def test_each_fault_is_tried_or_said_to_be_left_out(tmp_path: Path) -> None:
    only = [word for name in NAMES for word in ("--only", name)]
    out = tmp_path / "faults.md"
    command = [
        sys.executable,
        "-m",
        "verification.faults",
        "--repeat",
        "1",
        *only,
        "--out",
        str(out),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = out.read_text(encoding="utf-8").splitlines()
    assert done.stdout.rstrip("\n") == "\n".join(lines).rstrip("\n")
    for name in NAMES:
        tried = [line for line in lines if line.startswith(f"| {name} | 1 |")]
        left_out = [line for line in lines if line.startswith(f"Left out: {name}: ")]
        assert len(tried) + len(left_out) == 1, name
        assert all(line.endswith("| ok |") for line in tried)
    assert any(line.startswith("| contact in one sample | 1 |") for line in lines)


def test_a_name_that_no_fault_has_is_refused() -> None:
    command = [sys.executable, "-m", "verification.faults", "--only", "a rainy day"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "a rainy day" in done.stderr
    assert FAULTS[0].name in done.stderr
