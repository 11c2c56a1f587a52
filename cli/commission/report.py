"""Verdicts of the steps, and the report of a checkout in Markdown. Pure."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

Outcome = Literal["passed", "failed", "skipped"]
Row = tuple[str, str]  # a measured quantity, and its value with unit
# Data of a manoeuvre, in the order of the report.
COLUMNS = ("commanded", "measured", "counted", "noise", "reaction", "deceleration",
           "stop distance", "needed", "reckoned")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Verdict:
    """Outcome of a step, with reasons and data."""

    outcome: Outcome
    text: str
    data: tuple[Row, ...] = ()


def judged(problems: Iterable[str], passed: str, data: Iterable[Row] = ()) -> Verdict:
    """Return ``failed`` with all problems; without problems ``passed`` with the given text."""
    found = [problem for problem in problems if problem]
    return Verdict("failed" if found else "passed", " ".join(found) or passed, tuple(data))


def failed(problem: str) -> Verdict:
    """Return the verdict of a step that ended early."""
    return Verdict("failed", problem)


def seconds(value: float | None, digits: int = 2) -> str:
    """Return a time as text; None means that the event did not occur."""
    return "never" if value is None else f"{value:.{digits}f} s"


@dataclass(slots=True)
class Report:
    """Content of the report; the checkout fills it in, so that an abort loses nothing."""

    robot: str
    date: str
    facts: list[Row]  # board, versions, firmware
    settings: Sequence[tuple[str, str, str]]  # path, value, origin
    operator: str = ""
    steps: list[tuple[str, Verdict]] = field(default_factory=list)  # by title
    manoeuvres: list[tuple[str, Verdict]] = field(default_factory=list)  # of the guided drive
    left_out: Sequence[str] = ()  # steps or manoeuvres that the options exclude
    aborted: str = ""  # reason of an early end
    signed: str = ""  # the name typed at the end
    ended: str = ""  # date of the end

    @property
    def passed(self) -> bool:
        """Whether each selected step passed, to the end, with a signature."""
        done = [*self.steps, *self.manoeuvres]
        good = all(verdict.outcome == "passed" for _, verdict in done)
        return bool(done) and good and not self.aborted and bool(self.signed)


def render(report: Report) -> str:
    """Return the report as Markdown."""
    about = [("date", report.date), ("operator", report.operator), *report.facts]
    signature = f"{_cell(report.signed)}, {report.ended}" if report.signed else "Not signed."
    parts = [
        [f"# Checkout of robot {_cell(report.robot)}", "", _headline(report)],
        _table(("what", "value"), about),
        *(_steps(report.steps) if report.steps or not report.manoeuvres else ()),
        *(_manoeuvres(report.manoeuvres) if report.manoeuvres else ()),
        ["## Effective settings", ""],
        _table(("setting", "value", "from"), report.settings),
        ["## Signed off", "", signature],
    ]
    return "\n\n".join("\n".join(part).rstrip("\n") for part in parts) + "\n"


def _steps(steps: Sequence[tuple[str, Verdict]]) -> Iterator[list[str]]:
    """Yield the parts on the steps: one table of all, and one of each step's data."""
    yield ["## Steps", ""]
    yield _table(
        ("step", "result", "finding"),
        [(title, verdict.outcome, verdict.text) for title, verdict in steps],
    )
    for title, verdict in steps:
        if verdict.data:
            yield [f"### {_cell(title)}", "", *_table(("measured", "value"), verdict.data)]


def _manoeuvres(done: Sequence[tuple[str, Verdict]]) -> Iterator[list[str]]:
    """Yield the parts on the guided drive: one row a manoeuvre."""
    yield ["## Manoeuvres", ""]
    rows = []
    for title, verdict in done:
        data = dict(verdict.data)
        figures = (data.get(name, "") for name in COLUMNS)
        rows.append((title, *figures, verdict.outcome, verdict.text))
    yield _table(("manoeuvre", *COLUMNS, "result", "finding"), rows)


def _headline(report: Report) -> str:
    lines = ["**Passed.**" if report.passed else "**Not passed.**"]
    if report.aborted:
        lines.append(f"Ended early: {_cell(report.aborted)}.")
    if report.left_out:
        lines.append(f"Partial checkout, left out: {', '.join(report.left_out)}.")
    return " ".join(lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(map(_cell, line))} |" for line in lines]


def _cell(text: str) -> str:
    """Return a text with pipes escaped and line breaks removed."""
    return " ".join(text.replace("|", "\\|").split())
