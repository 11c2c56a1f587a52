"""What became of each mutant, against the list of those that may live.

A mutant is known by its file, its function and the lines that it takes away and puts in, so that an
edit elsewhere does not give it a new name. It counts as killed only when a test failed. Whatever
else happens to it, an endless loop among that, must stand in the list with its reason; and what
stands in the list must happen.
"""

import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

KILLED = 1  # pytest: a test failed
OUTCOMES = {0: "survived", 33: "untested", 36: "endless", -24: "endless", 24: "endless"}


@dataclass(frozen=True, slots=True, order=True)
class Mutant:
    """One change of the source that no test noticed, and in which way."""

    file: str
    function: str
    old: str  # lines without their indent
    new: str
    outcome: str

    def __str__(self) -> str:
        """Show it as it would stand in the list."""
        return (
            f'[[mutant]]\nfile = "{self.file}"\nfunction = "{self.function}"\n'
            f"old = '''{self.old}'''\nnew = '''{self.new}'''\n"
            f'outcome = "{self.outcome}"\nreason = ""\n'
        )


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mutant that may live, and why it is no fault of the tests."""

    file: str
    function: str
    old: str
    new: str
    outcome: str
    reason: str

    @property
    def mutant(self) -> Mutant:
        """Return what it allows."""
        return Mutant(self.file, self.function, self.old, self.new, self.outcome)


def entries(path: Path) -> list[Entry]:
    """Read the list; raise ``msgspec.ValidationError`` for one that is none."""
    listed = msgspec.convert(tomllib.loads(path.read_text("utf-8")), dict[str, list[Entry]])
    return listed.get("mutant", [])


def outcome(exit_code: int | None) -> str:
    """Name what a test run came to; empty when the mutant was killed."""
    if exit_code == KILLED:
        return ""
    return OUTCOMES.get(exit_code, f"exit code {exit_code}") if exit_code is not None else "not run"


def changed_lines(diff: str) -> tuple[str, str]:
    """Return the lines that a unified diff takes away and puts in, without their indent."""
    body = [line for line in diff.splitlines() if not line.startswith(("---", "+++"))]
    old, new = (
        "\n".join(line[1:].strip() for line in body if line.startswith(sign)) for sign in "-+"
    )
    return old, new


def complaints(
    tried: Mapping[str, int], alive: Sequence[Mutant], listed: Iterable[Entry]
) -> list[str]:
    """Return what is wrong, given how many mutants of each file were tried; empty if nothing is."""
    allowed = [entry for entry in listed if entry.file in tried]
    may, are = Counter(entry.mutant for entry in allowed), Counter(alive)
    return [
        *(f"{file}: mutmut made no mutant of it." for file, count in tried.items() if not count),
        *(f"{one.file}: {one.function}: no reason given." for one in allowed if not one.reason),
        *(f"Not in the list:\n\n{one}" for one in sorted((are - may).elements())),
        *(f"In the list, but killed or gone:\n\n{one}" for one in sorted((may - are).elements())),
    ]
