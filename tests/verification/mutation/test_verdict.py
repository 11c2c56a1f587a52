"""The gate itself: what it lets pass and what it does not."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from verification.mutation import verdict as gate
from verification.mutation.verdict import Entry, Mutant, changed_lines, complaints, entries, outcome

LOOSE = Mutant("a.py", "f", "x < 1", "x <= 1", "survived")
ALLOWED = Entry("a.py", "f", "x < 1", "x <= 1", "survived", "x is never 1")


@pytest.mark.parametrize(
    ("exit_code", "name"),
    [
        (1, ""),
        (0, "survived"),
        (33, "untested"),
        (36, "endless"),
        (-24, "endless"),
        (None, "not run"),
        (3, "exit code 3"),
        (-9, "exit code -9"),
    ],
)
def test_only_a_failed_test_kills(exit_code: int | None, name: str) -> None:
    assert outcome(exit_code) == name


def test_all_killed_is_good() -> None:
    assert complaints({"a.py": 3}, [], []) == []


def test_what_lives_must_be_listed_as_often_as_it_lives() -> None:
    assert len(complaints({"a.py": 3}, [LOOSE], [])) == 1
    assert complaints({"a.py": 3}, [LOOSE], [ALLOWED]) == []
    assert len(complaints({"a.py": 3}, [LOOSE, LOOSE], [ALLOWED])) == 1


@pytest.mark.parametrize(
    "other",
    [
        replace(LOOSE, file="b.py"),
        replace(LOOSE, function="g"),
        replace(LOOSE, old="x < 2"),
        replace(LOOSE, new="x > 1"),
        replace(LOOSE, outcome="endless"),
    ],
)
def test_an_entry_allows_one_mutant_only(other: Mutant) -> None:
    found = complaints({"a.py": 3, "b.py": 3}, [other], [ALLOWED])
    assert [text.split(":")[0] for text in found] == [
        "Not in the list",
        "In the list, but killed or gone",
    ]


def test_an_entry_goes_when_its_mutant_is_killed_but_only_if_that_was_tried() -> None:
    assert "killed or gone" in complaints({"a.py": 3}, [], [ALLOWED])[0]
    assert complaints({"b.py": 3}, [], [ALLOWED]) == []


def test_an_entry_needs_a_reason() -> None:
    silent = msgspec.structs.replace(ALLOWED, reason="")
    assert complaints({"a.py": 3}, [LOOSE], [silent]) == ["a.py: f: no reason given."]


def test_a_file_without_mutants_is_an_error() -> None:
    assert complaints({"a.py": 0}, [], []) == ["a.py: mutmut made no mutant."]


def test_a_diff_is_known_by_its_changed_lines() -> None:
    diff = "--- a.py\n+++ a.py\n@@ -1,2 +1,2 @@\n def f(x):\n-    return x < 1\n+    return x <= 1"
    assert changed_lines(diff) == ("return x < 1", "return x <= 1")


def test_what_is_shown_can_be_put_into_the_list(tmp_path: Path) -> None:
    path = tmp_path / "allowed.toml"
    path.write_text(str(LOOSE), "utf-8")
    assert [entry.mutant for entry in entries(path)] == [LOOSE]
    path.write_text("", "utf-8")
    assert entries(path) == []


def test_the_list_is_one() -> None:
    listed = entries(Path(gate.__file__).with_name("allowed.toml"))
    assert all(entry.reason for entry in listed)
