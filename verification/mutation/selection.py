"""Which files are cores, and which tests have to notice every change of them.

``[tool.coverage.report]`` of ``pyproject.toml`` names the cores. The tests of a core are those of
its folder below ``tests/``, or of its name. They start no process and reach no bus.
"""

import subprocess
import tomllib
from pathlib import Path

UNMIRRORED = {"services", "t2"}  # folders that the tests do not repeat
FOLDERS = {"core", "wire"}  # their tests belong to every file of them

Cores = dict[str, list[str]]  # tests of each file


def cores() -> Cores:
    """Return the cores of the current folder with their tests; ValueError without a test."""
    settings = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["tool"]["coverage"]
    found: Cores = {}
    for pattern in settings["report"]["include"]:
        for path in sorted(Path().glob(pattern)):
            if "def " in path.read_text("utf-8"):  # otherwise data only: nothing to mutate
                found[str(path)] = tests_of(path)
    return found


def tests_of(core: Path) -> list[str]:
    """Return the test files of a core."""
    folder = Path("tests", *(name for name in core.parent.parts if name not in UNMIRRORED))
    name = "test_*.py" if core.parent.name in FOLDERS else f"test_{core.stem}*.py"
    if not (found := sorted(map(str, folder.glob(name)))):
        raise ValueError(f"{core}: no test in {folder}")
    return found


def changed(cores: Cores) -> Cores:
    """Return the cores that differ from the fork point of the branch, committed or not.

    On main they are compared with the previous commit.
    """
    head, fork = _git("rev-parse", "HEAD"), _git("merge-base", "origin/main", "HEAD")
    commit = fork if fork and fork != head else _git("rev-parse", "--verify", "HEAD~1")
    diff = None if commit is None else _git("diff", "--name-only", "--relative", commit)
    if commit is None or diff is None:
        print("mutants: skipped, no commit to compare with; `make mutants` tests all cores")
        return {}
    chosen = {file: tests for file, tests in cores.items() if file in diff.splitlines()}
    print(f"mutants: since {commit[:7]}: {', '.join(chosen) or 'no core changed'}", flush=True)
    return chosen


def _git(*words: str) -> str | None:
    """Return the output of git; None when it fails or is missing."""
    try:
        done = subprocess.run(["git", *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
