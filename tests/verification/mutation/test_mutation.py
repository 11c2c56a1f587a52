"""The gate: which survivors it refuses, and one real run."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from verification.mutation.equivalent import Row, TableError, check, table
from verification.mutation.selection import cores
from verification.mutation.trial import Survivor, complaints, function_of, run

ROOT = Path(__file__).parents[3]
SOURCE = """\
class C:
    def f(self, x):
        return x < 1


def g(x):
    def inner():
        return x
    return x < 1
"""
ROW = Row(file="a.py", function="C.f", line="return x < 1", mutants=2, why="x is never 1.")


def survivor(
    line: str = "    return x < 1", outcome: str = "survived", function: str = "C.f"
) -> Survivor:
    diff = f"--- a.py\n+++ a.py\n@@ -1,2 +1,2 @@\n def f(x):\n-{line}\n+    pass"
    return Survivor(outcome, function, diff)


@pytest.fixture(autouse=True)
def _in_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_as_many_survive_as_the_row_gives() -> None:
    assert complaints([ROW], [survivor(), survivor(outcome="endless")]) == []
    assert complaints([ROW], [survivor()])[0].startswith("1 survivors, 2 equivalent")
    assert complaints([ROW], [])[0].startswith("0 survivors, 2 equivalent")
    other = [survivor(), survivor(), survivor("    return 0", "untested")]
    (complaint,) = complaints([ROW], other)
    begin = "1 survivors, 0 equivalent in the table: C.f: return 0\nuntested\n---"
    assert complaint.startswith(begin)


def test_the_same_line_of_another_function_is_another_line() -> None:
    found = [survivor(), survivor(), survivor(function="g")]
    (complaint,) = complaints([ROW], found)
    assert complaint.startswith("1 survivors, 0 equivalent in the table: g: return x < 1\n")


@pytest.mark.parametrize(
    ("mutant", "function"),
    [("a.b.x_run__mutmut_12", "run"), ("a.b.xǁTopǁ_go__mutmut_1", "Top._go")],
)
def test_the_function_of_a_mutant(mutant: str, function: str) -> None:
    assert function_of(mutant) == function


def test_a_row_fits_a_line_of_its_function(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(SOURCE)
    check((ROW, replace(ROW, function="g"), replace(ROW, function="g", line="return x")), tmp_path)


@pytest.mark.parametrize(
    ("rows", "name"),
    [
        ((replace(ROW, line="return x <= 1"),), "no such line: a.py, C.f: return x <= 1"),
        ((replace(ROW, function="f"),), "no such line: a.py, f: return x < 1"),
        ((replace(ROW, file="b.py"),), "no such line: b.py, C.f: return x < 1"),
        ((ROW, ROW), "twice: a.py, C.f: return x < 1"),
    ],
)
def test_an_error_names_the_row_that_fits_no_line(
    rows: tuple[Row, ...], name: str, tmp_path: Path
) -> None:
    (tmp_path / "a.py").write_text(SOURCE)
    with pytest.raises(TableError) as error:
        check(rows, tmp_path)
    assert name in str(error.value)


def test_each_row_of_the_table_fits() -> None:
    check(table(), ROOT)
    assert {row.file for row in table()} <= cores().keys()


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
