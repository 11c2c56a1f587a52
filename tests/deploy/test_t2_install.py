"""``t2-install.sh`` without a network: install, upgrade, rollback, errors."""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.deploy.wheelhouse import OFFLINE, SCRIPT, bundled_pip, offline, seal, wheelhouse

PIP = bundled_pip()
LACKING = offline() or ("" if PIP else "this Python has no bundled pip")
pytestmark = pytest.mark.skipif(bool(LACKING), reason=f"t2-install.sh cannot run: {LACKING}")

Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path / "opt"


@pytest.fixture
def house(tmp_path: Path) -> Callable[[str], Path]:
    """Create a wheelhouse of a version."""
    assert PIP is not None
    pip = PIP
    return lambda version: wheelhouse(tmp_path / f"wheelhouse-{version}", version, pip)


@pytest.fixture
def run(home: Path, tmp_path: Path) -> Run:
    """Run the script of a wheelhouse."""

    def made(folder: Path, *words: str, **environ: str) -> "subprocess.CompletedProcess[str]":
        given = {"T2_HOME": str(home), "T2_ROOT": str(tmp_path / "root")} | environ
        return subprocess.run(
            [*OFFLINE, "sh", str(folder / "t2-install.sh"), *words],
            env=os.environ | given, capture_output=True, text=True, timeout=100, check=False,
        )  # fmt: skip

    return made


def link(home: Path, name: str) -> str:
    """Return the version that a link names, without its digest."""
    return str((home / name).readlink()).partition("-")[0]


@pytest.mark.campaign
def test_install_again_upgrade_and_roll_back(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    one = house("1.0")
    first = run(one, "--sim")
    assert first.returncode == 0, first.stderr
    assert f"making {home}/1.0-" in first.stdout
    prefix = f"--prefix {home}/current"
    assert f"t2 1.0 install --root {home.parent}/root {prefix} --sim\n" in first.stdout
    assert link(home, "current") == "1.0"
    assert not (home / "previous").exists()

    again = run(one)
    assert again.returncode == 0
    assert "exists already" in again.stdout
    assert not (home / "previous").exists()

    upgrade = run(house("2.0"))
    assert upgrade.returncode == 0, upgrade.stderr
    assert (link(home, "current"), link(home, "previous")) == ("2.0", "1.0")

    back = run(one, "--rollback")
    assert back.returncode == 0, back.stderr
    assert "t2 1.0 install" in back.stdout
    assert (link(home, "current"), link(home, "previous")) == ("1.0", "2.0")
    forth = run(one, "--rollback")
    assert "t2 2.0 install" in forth.stdout


@pytest.mark.campaign
def test_another_build_of_a_version_has_its_own_folder(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    folder = house("1.0")
    run(folder)
    requirements = folder / "requirements.txt"
    requirements.write_text("# another build\n" + requirements.read_text())
    seal(folder)
    assert run(folder).returncode == 0
    assert len(list(home.glob("1.0-*"))) == 2


@pytest.mark.campaign
def test_a_version_that_rejects_the_settings_is_not_activated(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    run(house("1.0"))
    refused = run(house("2.0"), T2_TEST_REFUSES="2.0")
    assert refused.returncode == 1
    assert "the settings will not do" in refused.stderr
    assert "cannot run with these settings; nothing was changed" in refused.stderr
    assert link(home, "current") == "1.0"


@pytest.mark.parametrize(
    "words", [("--rolback",), ("--help",), ("--dry-run",), ("--rollback", "--sim"), ("--sim", "x")]
)
def test_unknown_arguments_change_nothing(
    home: Path, house: Callable[[str], Path], run: Run, words: tuple[str, ...]
) -> None:
    refused = run(house("1.0"), *words)
    assert refused.returncode == 1
    assert f"unknown arguments '{' '.join(words)}'; nothing was changed" in refused.stderr
    assert "[--sim | --rollback]" in refused.stderr
    assert not home.exists()


@pytest.mark.campaign
def test_the_dry_run_uses_the_same_arguments(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    assert run(house("1.0"), "--sim", T2_TEST_REFUSES="--sim").returncode == 1
    assert not (home / "current").exists()


@pytest.mark.campaign
def test_an_interrupted_build_is_repeated(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    folder = house("1.0")
    run(folder)
    (version,) = home.glob("1.0-*")
    (version / ".complete").unlink()
    (version / "bin" / "python").unlink()
    assert "making" in run(folder).stdout
    assert (version / "bin" / "python").exists()


def test_a_damaged_wheelhouse_is_rejected(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    folder = house("1.0")
    (folder / "t2-1.0-py3-none-any.whl").write_bytes(b"damaged")
    refused = run(folder)
    assert refused.returncode == 1
    assert "is damaged: copy it again" in refused.stderr
    assert list(home.iterdir()) == []


@pytest.mark.campaign
def test_a_wheel_with_another_hash_is_rejected(
    home: Path, house: Callable[[str], Path], run: Run
) -> None:
    folder = house("1.0")
    with (folder / "t2-1.0-py3-none-any.whl").open("ab") as file:
        file.write(b"\0")
    seal(folder)  # an attacker can renew the checksums, but not pip's locked hashes
    refused = run(folder)
    assert refused.returncode == 1
    assert "DO NOT MATCH THE HASHES" in refused.stderr
    assert not (home / "current").exists()


def test_missing_requirements(home: Path, house: Callable[[str], Path], run: Run) -> None:
    folder = house("1.0")
    assert "needs Python 3.11 or newer" in run(folder, PYTHON="false").stderr
    assert "there is no previous version" in run(folder, "--rollback").stderr
    (folder / "VERSION").unlink()
    assert "is not a wheelhouse, VERSION is missing" in run(folder).stderr
    assert list(home.iterdir()) == []


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_shellcheck_passes() -> None:
    done = subprocess.run(["shellcheck", SCRIPT], capture_output=True, text=True, check=False)
    assert done.stdout == ""
