"""The relay's unit and image recipe."""

import shutil
import subprocess
from configparser import RawConfigParser
from pathlib import Path

import pytest

import services.relay

DEPLOY = Path(__file__).parents[2] / "deploy" / "relay"
FOLDER = Path(services.relay.__file__).parent


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_shellcheck_passes() -> None:
    command = ["shellcheck", str(DEPLOY / "image.sh")]
    assert subprocess.run(command, capture_output=True, text=True, check=False).stdout == ""


def test_the_recipe_installs_the_program_and_its_unit(tmp_path: Path) -> None:
    root, tools = tmp_path / "root", tmp_path / "tools"
    for folder in ("usr/bin", "etc/systemd/system"):
        (root / folder).mkdir(parents=True)
    (root / "usr/bin/python3").symlink_to("/bin/true")
    tools.mkdir()
    (tools / "systemctl").symlink_to("/bin/true")
    environ = {"PATH": f"{tools}:/usr/bin:/bin"}
    subprocess.run(["sh", str(DEPLOY / "image.sh"), str(root)], check=True, env=environ)
    copied = {path.name: path.read_bytes() for path in (root / "opt/t2/relay").iterdir()}
    assert copied == {path.name: path.read_bytes() for path in FOLDER.glob("*.py")}
    assert (root / "etc/systemd/system/t2-relay.service").exists()
    assert "ip_forward = 0" in (root / "etc/sysctl.d/90-t2-relay.conf").read_text()


def test_a_root_without_python_is_named(tmp_path: Path) -> None:
    command = ["sh", str(DEPLOY / "image.sh"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 66
    assert f"{tmp_path} has no usr/bin/python3" in done.stderr


def test_the_unit_restarts_the_relay_at_once_and_watches_it() -> None:
    unit = RawConfigParser(strict=False)
    unit.read(DEPLOY / "t2-relay.service")
    service = unit["Service"]
    assert (service["Restart"], service["RestartSec"]) == ("always", "50ms")
    assert (service["Type"], service["WatchdogSec"]) == ("notify", "500ms")
    assert service["ExecStart"].endswith("-m relay")


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_accepts_the_unit() -> None:
    command = ["systemd-analyze", "verify", "--man=no", str(DEPLOY / "t2-relay.service")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert [line for line in done.stderr.splitlines() if "t2-relay" in line] == []
