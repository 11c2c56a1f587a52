"""The second run of failed tests, with a small suite."""

import os
import subprocess
import sys
from pathlib import Path

from tools.run_tests import NAMES, RETRIED_MAX

SCRIPT = Path(__file__).parents[2] / "tools/run_tests.py"
FAILS_ONCE = """
from pathlib import Path

def test_passes():
    pass

def test_fails_once():
    mark = Path("mark")
    if not mark.exists():
        mark.touch()
        assert False
"""
HANGS_ONCE = FAILS_ONCE.replace("assert False", "import time; time.sleep(60)")
MANY_FAIL = f"""
import pytest

@pytest.mark.parametrize("n", range({RETRIED_MAX + 1}))
def test_it(n):
    assert False
"""
INI = "[pytest]\naddopts = -q -rs\nfaulthandler_timeout = 3\nfaulthandler_exit_on_timeout = true\n"
NAMED = "passed the second time only: test_it.py::test_fails_once\n"


def run(folder: Path, tests: str, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run a suite of one file in an empty folder."""
    (folder / "test_it.py").write_text(tests, encoding="utf-8")
    (folder / "pytest.ini").write_text(INI, encoding="utf-8")
    # Other plugins take longer to load than these tests to run.
    only_xdist = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_PLUGINS": "xdist.plugin"}
    return subprocess.run(
        [sys.executable, str(SCRIPT), *words],
        cwd=folder, env=os.environ | only_xdist, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_test_that_fails_once_is_named_last(tmp_path: Path) -> None:
    (tmp_path / NAMES.parent).mkdir()
    (tmp_path / NAMES).write_text("of an earlier run\n", encoding="utf-8")
    done = run(tmp_path, FAILS_ONCE, "-n", "2")
    assert done.returncode == 0, done.stdout
    assert "1 failed, 1 passed" in done.stdout
    assert done.stdout.endswith(f"of an earlier run\n{NAMED}")
    assert (tmp_path / NAMES).read_text(encoding="utf-8") == f"of an earlier run\n{NAMED}"


def test_a_test_that_hangs_is_named_with_its_stack(tmp_path: Path) -> None:
    done = run(tmp_path, HANGS_ONCE, "-n", "2")
    assert done.returncode == 0, done.stdout
    assert "in test_fails_once" in done.stderr
    assert done.stdout.endswith(NAMED)


def test_many_failures_have_no_second_run(tmp_path: Path) -> None:
    done = run(tmp_path, MANY_FAIL)
    assert done.returncode == 1
    assert "they run once more" not in done.stdout
    assert not (tmp_path / NAMES).exists()
