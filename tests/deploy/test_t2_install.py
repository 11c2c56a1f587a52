"""``t2-install.sh`` without a network: install, upgrade, rollback, errors."""

import ensurepip
import hashlib
import os
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

DEPLOY = Path(__file__).parents[2] / "deploy"
INSTALL = DEPLOY / "t2-install.sh"
OFFLINE = ("unshare", "--map-root-user", "--net")  # root of nothing, and without a network
PIP = list((Path(ensurepip.__file__).parent / "_bundled").glob("pip-*.whl"))
IS_OFFLINE = subprocess.run(["sh", "-c", f"{' '.join(OFFLINE)} true"], check=False).returncode == 0
needs_offline = pytest.mark.skipif(
    not (IS_OFFLINE and PIP), reason="needs `unshare` and a Python with a bundled pip"
)
MAIN = """
import os, sys
print("t2", "{version}", *sys.argv[1:])
refused = os.environ.get("T2_TEST_REFUSES") == "{version}"
sys.exit("the settings will not do" if refused else 0)
"""
Run = Callable[..., "subprocess.CompletedProcess[str]"]


def wheelhouse(folder: Path, version: str) -> Path:
    """Write a wheelhouse as `make wheelhouse` does: pip, and a T2 that prints its arguments."""
    folder.mkdir()
    info, wheel = f"t2-{version}.dist-info", folder / f"t2-{version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("cli/__main__.py", MAIN.format(version=version))
        archive.writestr(
            f"{info}/METADATA", f"Metadata-Version: 2.1\nName: t2\nVersion: {version}\n"
        )
        archive.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        archive.writestr(f"{info}/RECORD", "")
    for file in (PIP[0], INSTALL):
        shutil.copy(file, folder)
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    (folder / "requirements.txt").write_text(f"t2=={version} --hash=sha256:{digest}\n")
    (folder / "VERSION").write_text(f"{version}\n")
    (folder / "PLATFORM").write_text("any\n")
    seal(folder)
    return folder


def seal(folder: Path) -> None:
    """Write the checksums of a wheelhouse."""
    files = sorted(path for path in folder.iterdir() if path.name != "SHA256SUMS")
    sums = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)
    (folder / "SHA256SUMS").write_text("".join(sums))


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path / "opt"


@pytest.fixture
def run(home: Path, tmp_path: Path) -> Run:
    """Run the script of a wheelhouse."""

    def run(folder: Path, *words: str, **environ: str) -> "subprocess.CompletedProcess[str]":
        given = {"T2_HOME": str(home), "T2_ROOT": str(tmp_path / "root")} | environ
        return subprocess.run(
            [*OFFLINE, "sh", str(folder / "t2-install.sh"), *words],
            env=os.environ | given, capture_output=True, text=True, timeout=100, check=False,
        )  # fmt: skip

    return run


def link(home: Path, name: str) -> str:
    """Return the version that a link names, without its digest."""
    return str((home / name).readlink()).partition("-")[0]


@needs_offline
@pytest.mark.campaign
def test_install_upgrade_and_roll_back(home: Path, tmp_path: Path, run: Run) -> None:
    one, two = (wheelhouse(tmp_path / version, version) for version in ("1.0", "2.0"))
    first = run(one, "--sim")
    assert first.returncode == 0, first.stderr
    prefix = f"--prefix {home}/current"
    assert f"t2 1.0 install --root {tmp_path}/root {prefix} --sim\n" in first.stdout
    assert "exists already" in run(one).stdout
    assert not (home / "previous").exists()

    refused = run(two, T2_TEST_REFUSES="2.0")
    assert refused.returncode == 1
    assert "cannot run with these settings; nothing was changed" in refused.stderr
    assert link(home, "current") == "1.0"

    assert run(two).returncode == 0
    assert (link(home, "current"), link(home, "previous")) == ("2.0", "1.0")
    assert "t2 1.0 install" in run(one, "--rollback").stdout
    assert (link(home, "current"), link(home, "previous")) == ("1.0", "2.0")

    (version,) = home.glob("1.0-*")
    (version / ".complete").unlink()  # an interrupted build
    assert "making" in run(one).stdout


@needs_offline
@pytest.mark.parametrize("words", [("--rolback",), ("--dry-run",), ("--rollback", "--sim")])
def test_unknown_arguments_change_nothing(
    home: Path, tmp_path: Path, run: Run, words: tuple[str, ...]
) -> None:
    refused = run(wheelhouse(tmp_path / "house", "1.0"), *words)
    assert refused.returncode == 1
    assert f"unknown arguments '{' '.join(words)}'; nothing was changed" in refused.stderr
    assert not home.exists()


@needs_offline
def test_a_damaged_or_forged_wheelhouse_is_rejected(home: Path, tmp_path: Path, run: Run) -> None:
    folder = wheelhouse(tmp_path / "house", "1.0")
    with (folder / "t2-1.0-py3-none-any.whl").open("ab") as file:
        file.write(b"\0")
    assert "is damaged: copy it again" in run(folder).stderr
    seal(folder)  # an attacker can renew the checksums, but not pip's locked hashes
    assert "DO NOT MATCH THE HASHES" in run(folder).stderr
    (folder / "VERSION").unlink()
    assert "is not a wheelhouse, VERSION is missing" in run(folder).stderr
    assert not (home / "current").exists()


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_shellcheck_passes() -> None:
    command = ["shellcheck", str(INSTALL), str(DEPLOY / "relay" / "image.sh")]
    assert subprocess.run(command, capture_output=True, text=True, check=False).stdout == ""
