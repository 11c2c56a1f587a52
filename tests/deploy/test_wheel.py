"""Content of the wheel, and its precedence over packages of the same names."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from common import child_process
from tests.cli.processes import PATIENCE_S, running, sets
from tests.cli.stack import STACK, ports, starts
from verification.harness.support import wait_until

ROOT = Path(__file__).parents[2]
SHIPPED = {"common", "services", "sim", "cli", "config", "deploy"}
FOREIGN = ("common", "services", "sim", "config")


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Return the paths in a wheel built from this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_the_wheel_contains_only_shipped_packages(names: set[str]) -> None:
    tops = {name.partition("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == SHIPPED
    assert not [name for name in names if "test" in name.lower()]
    assert {name for name in names if name.startswith("deploy/")} == {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "deploy/systemd").rglob("*")
        if path.is_file()
    }


def test_the_wheel_contains_every_module_and_data_file(names: set[str]) -> None:
    listed = ["git", "ls-files", *(SHIPPED - {"deploy"})]
    tracked = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True)
    assert set(tracked.stdout.split()) <= names


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """Return a folder with packages of the same names, as in a ROS workspace."""
    for name in FOREIGN:
        package = tmp_path / "workspace" / name
        package.mkdir(parents=True)
        (package / "__init__.py").write_text(f"raise ImportError('the foreign {name}')\n")
    return tmp_path / "workspace"


@pytest.mark.parametrize("is_on_path", [False, True], ids=["working directory", "PYTHONPATH"])
def test_foreign_packages_have_no_precedence(
    foreign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_on_path: bool
) -> None:
    monkeypatch.chdir(foreign)
    if is_on_path:
        monkeypatch.setenv("PYTHONPATH", str(foreign))
    log = tmp_path / "log"
    t2 = str(Path(sys.executable).with_name("t2"))
    settings = sets(*ports(), "log.format=json", f"recorder.folder={tmp_path}")
    with running([t2, "up", *settings], log) as up:
        wait_until(
            lambda: up.poll() is not None or all(starts(log, name) for name in STACK),
            "all six, or the end",
            PATIENCE_S,
        )
        assert up.poll() is None, log.read_text()
        up.terminate()
        assert up.wait(PATIENCE_S) == 0
    assert "foreign" not in log.read_text()


def test_the_environment_of_a_child_has_our_packages_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert child_process.environ()["PYTHONPATH"] == str(ROOT)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["/a", str(ROOT), "", "/b"]))
    assert child_process.environ()["PYTHONPATH"].split(os.pathsep) == [str(ROOT), "/a", "/b"]
