"""``t2`` from a wheel whose files share an environment with packages of the same names."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from cli.start import EXIT_CONFIG

ROOT = Path(__file__).parents[2]
START = "import sys; sys.path.insert(0, {!r}); from cli.start import main; sys.exit(main())"
COMPANY = "import nothing_that_exists\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the content of both wheels, as an installation writes it."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    for project in (ROOT, ROOT / "sdk"):
        subprocess.run(command, cwd=project, check=True, capture_output=True)
    for built in folder.glob("*.whl"):
        with zipfile.ZipFile(built) as archive:
            archive.extractall(folder / "site")
    return folder / "site"


@pytest.fixture
def site(wheel: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(wheel, tmp_path / "site"))


def t2(site: Path, *words: str, before: str = "") -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", before + START.format(str(site)), *words]
    return subprocess.run(
        command, cwd=site.parent, capture_output=True, text=True, timeout=60, check=False
    )


def installed(site: Path, *paths: str) -> None:
    """Install files of another package, and its list of files."""
    for path in paths:
        (site / path).parent.mkdir(parents=True, exist_ok=True)
        (site / path).write_text(COMPANY)
    lists = site / "acme_tools-3.1.dist-info"
    lists.mkdir()
    lists.joinpath("RECORD").write_text(
        "".join(f"{path},sha256=x,{len(COMPANY)}\n" for path in paths)
    )


def test_an_environment_of_its_own_is_accepted(site: Path) -> None:
    (site / "common" / "__pycache__").mkdir(exist_ok=True)
    (site / "company").mkdir()  # another name
    installed(site, "company/__init__.py")
    for _ in range(2):  # the second time with compiled files
        done = t2(site, "--version")
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("common/__init__.py", "is not the file of T2"),
        ("services/safety/core/motion.py", "is in a package of T2, but not of T2"),
        ("sim/__init__.py", "is not the file of T2"),
        ("t2/messages.py", "is not the file of T2"),
        ("cli/__init__.py", "is not the file of T2"),
    ],
)
def test_files_of_another_package_are_refused(site: Path, path: str, text: str) -> None:
    """Before one of them runs."""
    if path == "cli/__init__.py":
        (site / path).write_text("# of another package\n")
    else:
        installed(site, path)
    done = t2(site, "up")
    assert done.returncode == EXIT_CONFIG
    assert f"t2: {site / path} {text}" in done.stderr
    assert "Install T2 in an environment of its own" in done.stderr
    assert ("acme_tools-3.1 has installed it" in done.stderr) is (path != "cli/__init__.py")
    assert "nothing_that_exists" not in done.stderr


def test_missing_files_are_refused(site: Path) -> None:
    """As after the removal of the other package."""
    shutil.rmtree(site / "services")
    done = t2(site, "--version")
    assert done.returncode == EXIT_CONFIG
    assert f"t2: {site / 'services'}/" in done.stderr
    assert "is missing" in done.stderr


def test_a_foreign_package_that_is_imported_already_is_refused(site: Path, tmp_path: Path) -> None:
    """As by a ``.pth`` file or ``sitecustomize``."""
    other = tmp_path / "other"
    (other / "common").mkdir(parents=True)
    (other / "common" / "__init__.py").write_text("")
    before = f"import sys; sys.path.insert(0, {str(other)!r}); import common; "
    done = t2(site, "--version", before=before)
    assert done.returncode == EXIT_CONFIG
    assert f"Python imports {other / 'common' / '__init__.py'} as the package common" in done.stderr


def test_an_emergency_stop_is_tried_in_any_case(site: Path) -> None:
    installed(site, "common/acme.py")
    done = t2(site, "estop", "--help")
    assert done.returncode == 0
    assert "is in a package of T2, but not of T2" in done.stderr
    assert "USE THE VEHICLE'S OWN SWITCH" in done.stderr
    assert "emergency stop" in done.stdout
