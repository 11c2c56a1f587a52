"""Compare surviving mutants with the list of allowed ones.

A mutant is identified by its file, its function and the removed and added lines, so that an edit
elsewhere does not rename it. It counts as killed only when a test fails. Every other outcome, such
as an endless loop, must be in the list with a reason, and every listed outcome must occur.
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
    """One change of the source that no test detected, with its outcome."""

    file: str
    function: str
    old: str  # lines without their indent
    new: str
    outcome: str

    def __str__(self) -> str:
        """Format it as an entry of the list."""
        return (
            f'[[mutant]]\nfile = "{self.file}"\nfunction = "{self.function}"\n'
            f"old = '''{self.old}'''\nnew = '''{self.new}'''\n"
            f'outcome = "{self.outcome}"\nreason = ""\n'
        )


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An allowed mutant, with the reason."""

    file: str
    function: str
    old: str
    new: str
    outcome: str
    reason: str

    @property
    def mutant(self) -> Mutant:
        """The allowed mutant."""
        return Mutant(self.file, self.function, self.old, self.new, self.outcome)


def entries(path: Path) -> list[Entry]:
    """Read the list; raise ``msgspec.ValidationError`` for an invalid one."""
    listed = msgspec.convert(tomllib.loads(path.read_text("utf-8")), dict[str, list[Entry]])
    return listed.get("mutant", [])


def outcome(exit_code: int | None) -> str:
    """Return the outcome of a test run; empty when the mutant was killed."""
    if exit_code == KILLED:
        return ""
    return OUTCOMES.get(exit_code, f"exit code {exit_code}") if exit_code is not None else "not run"


def changed_lines(diff: str) -> tuple[str, str]:
    """Return the removed and added lines of a unified diff, without indent."""
    body = [line for line in diff.splitlines() if not line.startswith(("---", "+++"))]
    old, new = (
        "\n".join(line[1:].strip() for line in body if line.startswith(sign)) for sign in "-+"
    )
    return old, new


def complaints(
    tried: Mapping[str, int], survivors: Sequence[Mutant], listed: Iterable[Entry]
) -> list[str]:
    """Return the differences, given the number of mutants of each file; empty if there are none."""
    allowed = [entry for entry in listed if entry.file in tried]
    allowed_counts, found_counts = Counter(entry.mutant for entry in allowed), Counter(survivors)
    return [
        *(f"{file}: mutmut made no mutant." for file, count in tried.items() if not count),
        *(f"{one.file}: {one.function}: no reason given." for one in allowed if not one.reason),
        *(
            f"Not in the list:\n\n{one}"
            for one in sorted((found_counts - allowed_counts).elements())
        ),
        *(
            f"In the list, but killed or gone:\n\n{one}"
            for one in sorted((allowed_counts - found_counts).elements())
        ),
    ]
