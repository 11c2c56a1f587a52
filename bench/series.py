"""Samples of a row with their percentiles, and targets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from msgspec import Struct

from verification.harness.results import percentile, table

Share = Literal["p50", "p99", "max"]


class Series(Struct, frozen=True, kw_only=True):
    """The samples of one figure of one row."""

    name: tuple[str, ...]
    samples: Sequence[float]  # times in ns, other units by the benchmark's table

    def value(self, share: Share = "p50") -> float:
        """Return the median, the 99th percentile or the highest sample."""
        return percentile(self.samples, {"p50": 0.5, "p99": 0.99, "max": 1.0}[share])


class Measured(Struct, frozen=True, kw_only=True):
    """The result of one benchmark."""

    where: str  # date, machine, versions, and what was left out
    series: Sequence[Series]

    @property
    def by_name(self) -> dict[tuple[str, ...], Series]:
        """The series with samples, by name."""
        return {one.name: one for one in self.series if one.samples}


ByName = Mapping[tuple[str, ...], Series]


@dataclass(frozen=True, slots=True)
class Unit:
    """How a sample is printed."""

    name: str
    divisor: float
    digits: int = 0

    def text(self, value: float) -> str:
        """Return a number without its unit."""
        return f"{value / self.divisor:,.{self.digits}f}"


US, MS, CPU, ONE = Unit("us", 1e3), Unit("ms", 1e6, 1), Unit("CPU %", 1e7, 1), Unit("", 1)


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table: a figure of each row, or its median as a multiple of a row's."""

    head: str
    figure: str  # the last part of a series' name
    unit: Unit
    share: Share = "p50"
    of: tuple[str, ...] = ()

    def cell(self, by_name: ByName, row: tuple[str, ...]) -> str:
        """Return the text for a row; empty where it was not measured."""
        one, other = by_name.get((*row, self.figure)), by_name.get((*self.of, self.figure))
        if one is None or (self.of and other is None):
            return ""
        return (
            f"× {one.value() / other.value():.2f}"
            if other
            else self.unit.text(one.value(self.share))
        )


def columns(heads: Sequence[str], some: Sequence[Column], by_name: ByName) -> str:
    """Return the table of all rows; ``heads`` are of the parts of a row's name."""
    names = list(dict.fromkeys(name[:-1] for name in by_name))
    cells = [[*row, *(column.cell(by_name, row) for column in some)] for row in names]
    return table([*heads, *(f"{c.head} {c.unit.name}".strip() for c in some)], cells)


# Our row, the compared row, the figure, and the highest multiple.
Limits = Sequence[tuple[tuple[str, ...], tuple[str, ...], Column, float]]


def compared(question: str, limits: Limits, by_name: ByName) -> list[list[str]]:
    """Return a row for each limit whose figures were measured; the first has the question."""
    rows: list[list[str]] = []
    for ours, theirs, column, limit in limits:
        both = [by_name.get((*row, column.figure)) for row in (ours, theirs)]
        mine, other = (one.value(column.share) if one else 0.0 for one in both)
        if all(both) and other:
            texts = [f"{column.unit.text(value)} {column.unit.name}" for value in (mine, other)]
            rows.append([
                "" if rows else question, f"{', '.join([*ours, column.head])}: {texts[0]}",
                f"{', '.join(theirs)}: {texts[1]}", f"× {mine / other:.2f}",
                f"at most × {limit:g}", "reached" if mine <= limit * other else "not reached",
            ])  # fmt: skip
    return rows
