"""The report, in Markdown: what was checked on which vehicle, by whom, with which result."""

from collections.abc import Sequence
from dataclasses import dataclass

from cli.commission.verdict import Row, Verdict


@dataclass(frozen=True, slots=True)
class Checked:
    """A step and what it came to."""

    name: str
    title: str
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Report:
    """All that goes into the file."""

    robot: str
    date: str
    facts: Sequence[Row]  # board, firmware, versions
    settings: Sequence[tuple[str, str, str]]  # path, value, origin
    operator: str = ""
    steps: Sequence[Checked] = ()
    left_out: Sequence[str] = ()  # steps that were not asked for
    aborted: str = ""  # why it ended early
    signed: str = ""  # the name typed at the end
    ended: str = ""  # date of the end

    @property
    def passed(self) -> bool:
        """Whether each step that was asked for passed, to the end, and somebody signed."""
        good = all(step.verdict.outcome == "passed" for step in self.steps)
        return bool(self.steps) and good and not self.aborted and bool(self.signed)


def render(report: Report) -> str:
    """Return the report as a file's text."""
    about = [("date", report.date), ("operator", report.operator), *report.facts]
    parts = [
        [f"# Checkout of robot {_cell(report.robot)}", "", _headline(report)],
        _table(("what", "value"), about),
        ["## Steps", ""],
        _table(("step", "result", "finding"), [_step(step) for step in report.steps]),
        *(_measured(step) for step in report.steps if step.verdict.data),
        ["## Settings in force", ""],
        _table(("setting", "value", "from"), report.settings),
        ["## Signed off", "", _signature(report)],
    ]
    return "\n\n".join("\n".join(part).rstrip("\n") for part in parts) + "\n"


def _headline(report: Report) -> str:
    lines = ["**Passed.**" if report.passed else "**Not passed.**"]
    if report.aborted:
        lines.append(f"Ended early: {_cell(report.aborted)}.")
    if report.left_out:
        lines.append(f"Only a part: {', '.join(report.left_out)} were not asked for.")
    return " ".join(lines)


def _signature(report: Report) -> str:
    if not report.signed:
        return "Nobody has signed."
    return f"{_cell(report.signed)}, {report.ended}"


def _step(step: Checked) -> tuple[str, str, str]:
    return step.title, step.verdict.outcome, step.verdict.text


def _measured(step: Checked) -> list[str]:
    return [f"### {_cell(step.title)}", "", *_table(("measured", "value"), step.verdict.data)]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(map(_cell, line))} |" for line in lines]


def _cell(text: str) -> str:
    """Return a text that breaks no table."""
    return " ".join(text.replace("|", "\\|").split())
