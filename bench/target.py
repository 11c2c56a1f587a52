"""Targets: a figure of T2 compared with another one, and the verdict. Pure."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from verification.harness.results import table


@dataclass(frozen=True, slots=True)
class Target:
    """The limit of the ratio of two figures."""

    row: str  # the measured row of the section's table
    figure: str
    compared_with: str
    ratio: float
    limit: float
    at_least: bool = False  # the limit is the lowest ratio, else the highest one

    @property
    def is_reached(self) -> bool:
        """Return whether the ratio is within the limit."""
        return self.ratio >= self.limit if self.at_least else self.ratio <= self.limit

    @property
    def verdict(self) -> str:
        """Return the verdict in words."""
        return "reached" if self.is_reached else "not reached"

    @property
    def cells(self) -> list[str]:
        """Return figure, comparison, ratio, target and verdict."""
        bound = "at least" if self.at_least else "at most"
        ratio, limit = f"× {self.ratio:.2f}", f"{bound} × {self.limit:g}"
        return [f"{self.row}, {self.figure}", self.compared_with, ratio, limit, self.verdict]


def summary(answers: Iterable[tuple[str, Sequence[Target]]]) -> str:
    """Return the table of all targets; each question stands in its first row."""
    head = ["question", "figure", "compared with", "ratio", "target", "verdict"]
    rows = [
        ["" if number else question, *target.cells]
        for question, targets in answers
        for number, target in enumerate(targets)
    ]
    return table(head, rows)


def verdict_of(row: str, targets: Iterable[Target]) -> str:
    """Return the verdict on a row of a table with its worst miss; empty without a target."""
    ours = [each for each in targets if each.row == row]
    missed = [each for each in ours if not each.is_reached]
    if not ours:
        return ""
    verdict = f"{len(ours) - len(missed)} of {len(ours)} reached"
    if missed:
        worst = max(missed, key=lambda each: abs(each.ratio / each.limit - 1))
        verdict += f", worst × {worst.ratio:.2f} of × {worst.limit:g}"
    return verdict
