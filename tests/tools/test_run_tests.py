"""The second run of failed tests, with a small suite."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tools.run_tests import FAILED_BY_TIME, RETRIED_MAX

ROOT = Path(__file__).parents[2]
FIRST_TIME_ONLY = """
from pathlib import Path

def test_passes():
    pass

def test_fails_once():
    mark = Path("mark")
    if not mark.exists():
        mark.touch()
        assert False
"""

HANGS_ONCE = FIRST_TIME_ONLY.replace("assert False", "import time; time.sleep(60)")
INI = "[pytest]\naddopts = -q -rs\nfaulthandler_timeout = 3\nfaulthandler_exit_on_timeout = true\n"


def run(folder: Path, tests: str, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run a suite of one file in an empty folder."""
    (folder / "test_it.py").write_text(tests, encoding="utf-8")
    (folder / "pytest.ini").write_text(INI, encoding="utf-8")
    command = [sys.executable, str(ROOT / "tools/run_tests.py"), *words]
    # Other plugins take longer to load than these tests to run.
    only_xdist = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_PLUGINS": "xdist.plugin"}
    return subprocess.run(
        command,
        cwd=folder,
        env=os.environ | only_xdist,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("words", [(), ("-n", "2")])
def test_a_test_that_fails_once_is_named(tmp_path: Path, words: tuple[str, ...]) -> None:
    done = run(tmp_path, FIRST_TIME_ONLY, *words)
    assert done.returncode == 0, done.stdout
    assert "1 failed, 1 passed" in done.stdout
    assert done.stdout.endswith("passed the second time only:\n  test_it.py::test_fails_once\n")


def test_a_test_that_hangs_is_named_with_its_stack(tmp_path: Path) -> None:
    done = run(tmp_path, HANGS_ONCE, "-n", "2")
    assert done.returncode == 0, done.stdout
    assert "crashed while running 'test_it.py::test_fails_once'" in done.stdout
    assert "in test_fails_once" in done.stderr
    assert done.stdout.endswith("passed the second time only:\n  test_it.py::test_fails_once\n")


def test_a_test_that_hangs_without_workers_fails_the_run(tmp_path: Path) -> None:
    assert run(tmp_path, HANGS_ONCE).returncode == 1


def test_a_run_without_an_end_is_ended_with_all_stacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("T2_TESTS_LONGEST", "15")
    hangs = "import time\ndef test_hangs():\n    time.sleep(60)\n"
    done = run(tmp_path, hangs, "-n", "1", "-o", "faulthandler_timeout=0")
    assert done.returncode == FAILED_BY_TIME
    assert "not finished after 15 s" in done.stdout
    assert "in test_hangs" in done.stderr


def test_the_failures_of_other_runs_do_not_count(tmp_path: Path) -> None:
    cache = tmp_path / ".pytest_cache/v/cache"
    cache.mkdir(parents=True)
    others = {f"test_other.py::test_{number}": True for number in range(RETRIED_MAX + 1)}
    (cache / "lastfailed").write_text(json.dumps(others), encoding="utf-8")
    assert run(tmp_path, FIRST_TIME_ONLY).returncode == 0


def test_a_test_that_fails_twice_fails_the_run(tmp_path: Path) -> None:
    done = run(tmp_path, "def test_it():\n    assert False\n")
    assert done.returncode == 1
    assert done.stdout.count("1 failed") == 3  # pytest's two summaries, and ours
    assert "second time only" not in done.stdout


def test_a_suite_that_passes_runs_once(tmp_path: Path) -> None:
    done = run(tmp_path, "def test_it():\n    pass\n")
    assert done.returncode == 0
    assert done.stdout.count("passed") == 1


@pytest.mark.parametrize(
    "tests",
    [
        f"import pytest\n@pytest.mark.parametrize('n', range({RETRIED_MAX + 1}))\n"
        "def test_it(n):\n    assert False\n",
        "import no_such_module\n",
    ],
    ids=["many failures", "no collection"],
)
def test_other_failures_have_no_second_run(tmp_path: Path, tests: str) -> None:
    done = run(tmp_path, tests)
    assert done.returncode in (1, 2)
    assert "once more" not in done.stdout
