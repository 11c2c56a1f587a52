"""The host id: equal in all processes of a host, and 0 without a boot id."""

import subprocess
import sys
from pathlib import Path

import pytest

from common.bus.publisher import BOOT_ID, host_id


@pytest.mark.skipif(not BOOT_ID.exists(), reason="this system does not name its boot")
def test_another_process_of_this_host_has_the_same() -> None:
    code = "from common.bus.publisher import host_id; print(host_id())"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(ran.stdout) == host_id() != 0


def test_it_is_made_of_the_boots_own_name(tmp_path: Path) -> None:
    file = tmp_path / "boot_id"
    file.write_text("ffffffff-ffff-ffff-0000-000000000000\n", encoding="ascii")
    assert host_id(file) == 2**63 - 1
    file.write_text("00000000-0000-0002-ffff-ffffffffffff\n", encoding="ascii")
    assert host_id(file) == 1


@pytest.mark.parametrize("text", [None, "", "no such thing"])
def test_without_a_name_it_is_unknown(tmp_path: Path, text: str | None) -> None:
    file = tmp_path / "boot_id"
    if text is not None:
        file.write_text(text, encoding="ascii")
    assert host_id(file) == 0
