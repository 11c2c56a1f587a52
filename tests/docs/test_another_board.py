"""docs/another_board.md: its commands in a copy of the tree, with real processes."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.integrator import ROOT

PAGE = (ROOT / "docs" / "another_board.md").read_text(encoding="utf-8")


@pytest.mark.campaign
@pytest.mark.timeout(300)
def test_another_board_drives_the_lap(tmp_path: Path) -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True)
    for name in listed.stdout.decode().splitlines():
        if (ROOT / name).is_file():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tmp_path / name)
    (tmp_path / ".venv").symlink_to(Path(sys.executable).parents[1])
    patch, commands = (
        re.search(rf"^```{kind}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
        for kind in ("diff", "sh")
    )
    assert patch
    assert commands
    (tmp_path / "sonars.patch").write_text(patch[1], encoding="utf-8")
    done = subprocess.run(
        ["sh", "-eux", "-c", commands[1]],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": f"{tmp_path}:{tmp_path}/sdk"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert "on=True" in done.stdout
    assert (tmp_path / "out" / "lap.png").exists()  # the copy was driven
    for place in ("common/wire/frame.py", "services/relay/wire.py"):
        assert 'MAGIC = b"RV"' in (tmp_path / place).read_text(encoding="utf-8")
