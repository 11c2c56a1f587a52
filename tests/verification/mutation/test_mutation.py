"""The gate: which survivors it refuses, and one real run."""

from pathlib import Path

import pytest

from verification.mutation.selection import cores
from verification.mutation.trial import Survivor, complaints, marked, run

ROOT = Path(__file__).parents[3]
SOURCE = """\
def f(x):
    # 2 equivalent mutants: x is never 1.
    return x < 1
"""


def survivor(line: str = "    return x < 1", outcome: str = "survived") -> Survivor:
    return Survivor(outcome, f"--- a.py\n+++ a.py\n@@ -1,2 +1,2 @@\n def f(x):\n-{line}\n+    pass")


@pytest.fixture(autouse=True)
def _in_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_as_many_survive_as_the_mark_gives() -> None:
    assert marked(SOURCE) == {"return x < 1": 2}
    assert complaints(SOURCE, [survivor(), survivor(outcome="endless")]) == []
    assert complaints(SOURCE, [survivor()])[0].startswith("1 survivors, 2 marked")
    assert complaints(SOURCE, [])[0].startswith("0 survivors, 2 marked")
    other = [survivor(), survivor(), survivor("    return 0", "untested")]
    (complaint,) = complaints(SOURCE, other)
    assert complaint.startswith("1 survivors, 0 marked as equivalent: return 0\nuntested\n---")


@pytest.mark.campaign
@pytest.mark.timeout(600)
def test_a_run_finds_the_mutants_that_no_test_kills(tmp_path: Path) -> None:
    file = "common/motion.py"
    count, surviving = run(file, cores()[file], tmp_path / "all")
    assert count > 10
    assert surviving == []
    weak = "tests/common/test_motion.py::test_clamp"
    count, surviving = run(file, [weak], tmp_path / "weak")
    assert 0 < len(surviving) < count
    assert Path.cwd() == ROOT
