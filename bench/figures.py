"""Figures of a benchmark: their samples, tables with percentiles, and targets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from common.freshness import NS_PER_S
from verification.harness.results import percentile, table

Share = Literal["p50", "p99", "max"]
# Samples by the parts of a row's name and the figure: times in ns, other units by the table.
Figures = Mapping[tuple[str, ...], Sequence[float]]
# The figure that each measured row has: how late the host woke a sleeping process meanwhile, in ns.
HOST = "host"
PERIOD_NS = NS_PER_S // 500  # that it sleeps
UNLIKE, LITTLE_NS = 4, 100_000  # times the 99th percentile in the other row; less is alike


def value(samples: Sequence[float], share: Share = "p50") -> float:
    """Return the median, the 99th percentile or the highest sample."""
    return percentile(samples, {"p50": 0.5, "p99": 0.99, "max": 1.0}[share])


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
    """A column of a table: a figure of each row, or its median as a multiple of a row's.

    ``of`` is the beginning of that row's name; the rest is as in the row itself.
    """

    head: str
    figure: str  # the last part of its name in ``Figures``
    unit: Unit
    share: Share = "p50"
    of: tuple[str, ...] = ()

    def cell(self, figures: Figures, row: tuple[str, ...]) -> str:
        """Return the text for a row; empty where it was not measured."""
        samples = figures.get((*row, self.figure))
        theirs = (*self.of, *row[len(self.of) :])
        others = figures.get((*theirs, self.figure)) if self.of else samples
        if not samples or not others:
            return ""
        if self.of:
            return f"× {value(samples) / value(others):.2f}"
        return self.unit.text(value(samples, self.share))


HOST_COLUMNS = (Column("host, p99", HOST, US, "p99"), Column("longest", HOST, MS, "max"))


def columns(heads: Sequence[str], some: Sequence[Column], figures: Figures) -> str:
    """Return the table of all rows and their host; ``heads`` are of the parts of a row's name."""
    names = list(dict.fromkeys(name[:-1] for name in figures))
    every = [*some, *HOST_COLUMNS]
    cells = [[*row, *(column.cell(figures, row) for column in every)] for row in names]
    return table([*heads, *(f"{c.head} {c.unit.name}".strip() for c in every)], cells)


def stalled(late_ns: Sequence[float], column: Column) -> float:
    """Return how much of a figure can be the host's, in the unit of the figure.

    Of a percentile of times it is this percentile of the delays; of CPU, their share of the time.
    """
    if not late_ns:
        return 0.0
    if column.unit is CPU:
        return NS_PER_S * sum(late_ns) / (sum(late_ns) + PERIOD_NS * len(late_ns))
    return value(late_ns, column.share)


def is_unlike(*rows: Sequence[float]) -> bool:
    """Return whether the host behaved differently in two rows, by its delays in each."""
    low, high = sorted(value(late_ns, "p99") for late_ns in rows)
    return high > UNLIKE * max(low, LITTLE_NS)


# Our row, the compared row, the figure, and the highest multiple.
Limits = Sequence[tuple[tuple[str, ...], tuple[str, ...], Column, float]]


def compared(question: str, limits: Limits, figures: Figures) -> list[list[str]]:
    """Return a row for each limit whose figures were measured; the first has the question.

    Where the host's delays exceed a figure, or differ between two measured rows, there is no
    verdict.
    """
    rows: list[list[str]] = []
    for ours, theirs, column, limit in limits:
        both = [figures.get((*row, column.figure)) for row in (ours, theirs)]
        mine, other = (value(some, column.share) if some else 0.0 for some in both)
        if all(both) and other:
            texts = [f"{column.unit.text(each)} {column.unit.name}" for each in (mine, other)]
            hosts = [figures.get((*row, HOST), ()) for row in (ours, theirs)]
            late = [stalled(late_ns, column) for late_ns in hosts]
            verdict = "reached" if mine <= limit * other else "not reached"
            if late[0] > mine or late[1] > other:
                verdict = f"not comparable: host {column.unit.text(max(late))} {column.unit.name}"
            elif all(hosts) and is_unlike(*hosts):
                verdict = "not comparable: the host had changed"
            rows.append([
                "" if rows else question, f"{', '.join([*ours, column.head])}: {texts[0]}",
                f"{', '.join(theirs)}: {texts[1]}", f"× {mine / other:.2f}",
                f"at most × {limit:g}", verdict,
            ])  # fmt: skip
    return rows
