"""Verdicts of the steps, and the report of a checkout in Markdown. Pure."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import msgspec

from cli.commission.texts import ENGLISH, Say
from t2.words import Language

Outcome = Literal["passed", "failed", "skipped"]
Row = tuple[str, str]  # a measured quantity, and its value with unit
# The last line of a report is the report itself, for ``--resume``; a browser does not show it.
RECORD = re.compile(r"^<!-- t2 checkout (.*) -->$", re.MULTILINE)
# Data of a manoeuvre, in the order of the report.
COLUMNS = ("commanded", "measured", "counted", "noise", "reaction", "deceleration",
           "stop distance", "needed", "reckoned")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Verdict:
    """Outcome of a step, with reasons and data."""

    outcome: Outcome
    text: str
    data: tuple[Row, ...] = ()
    origin: str = ""  # date and operator of the report from which it was taken over

    @property
    def finding(self) -> str:
        """The text, with the origin of a verdict that was taken over."""
        return f"{self.text} [{self.origin}]" if self.origin else self.text


def judged(
    problems: Iterable[str], passed: str, data: Iterable[Row] = (), say: Say = ENGLISH
) -> Verdict:
    """Return ``failed`` with all problems; without problems ``passed`` with the given text."""
    found = [problem for problem in problems if problem]
    return Verdict("failed" if found else "passed", say.sentences(found) or passed, tuple(data))


def after(found: Verdict, earlier: Sequence[Verdict], say: Say) -> Verdict:
    """Return a verdict that names the different reasons of earlier attempts that failed."""
    texts = dict.fromkeys(each.text for each in earlier if each.text != found.text)
    if not texts:
        return found
    return replace(found, text=say("earlier", text=found.text, earlier=say.sentences(texts)))


def failed(problem: str) -> Verdict:
    """Return the verdict of a step that ended early."""
    return Verdict("failed", problem)


def seconds(value: float | None, digits: int = 2, say: Say = ENGLISH) -> str:
    """Return a time as text; None means that the event did not occur."""
    return say("never") if value is None else f"{value:.{digits}f} s"


@dataclass(slots=True)
class Report:
    """Content of the report; the checkout fills it in, so that an abort loses nothing."""

    robot: str
    date: str
    facts: list[Row]  # board, versions, firmware
    settings: Sequence[tuple[str, str, str]]  # path, value, origin
    operator: str = ""
    planned: list[str] = field(default_factory=list)  # titles of the steps
    steps: list[tuple[str, Verdict]] = field(default_factory=list)  # by title
    manoeuvres: list[tuple[str, Verdict]] = field(default_factory=list)  # of the guided drive
    left_out: Sequence[str] = ()  # steps or manoeuvres that the options exclude
    aborted: str = ""  # reason of an early end
    signed: str = ""  # the name typed at the end
    ended: str = ""  # date of the end
    language: Language = "en"  # of the texts

    @property
    def missing(self) -> list[str]:
        """The steps and manoeuvres that have not passed, also those not reached."""
        done = [*self.steps, *self.manoeuvres]
        passed = {title for title, verdict in done if verdict.outcome == "passed"}
        titles = dict.fromkeys([*self.planned, *(title for title, _ in done)])
        return [title for title in titles if title not in passed]

    @property
    def passed(self) -> bool:
        """Whether each selected step passed, to the end, with a signature."""
        is_done = bool(self.steps or self.manoeuvres)
        return is_done and not self.missing and not self.aborted and bool(self.signed)


def render(report: Report) -> str:
    """Return the report as Markdown."""
    say = Say(report.language)
    about = [
        (say("report.date"), report.date), (say("report.operator"), report.operator),
        *_named(report.facts, say),
    ]  # fmt: skip
    unsigned = say("report.unsigned")
    signature = f"{_cell(report.signed)}, {report.ended}" if report.signed else unsigned
    parts = [
        [f"# {say('report.title', robot=_cell(report.robot))}", "", _headline(report, say)],
        _table(_head(say, "what", "value"), about),
        *(_steps(report.steps, say) if report.steps or not report.manoeuvres else ()),
        *(_manoeuvres(report.manoeuvres, say) if report.manoeuvres else ()),
        [f"## {say('report.settings')}", ""],
        _table(_head(say, "setting", "value", "from"), report.settings),
        [f"## {say('report.signed')}", "", signature],
        [record(report)],
    ]
    return "\n\n".join("\n".join(part).rstrip("\n") for part in parts) + "\n"


def record(report: Report) -> str:
    """Return the report as a comment of Markdown."""
    text = msgspec.json.encode(report).decode().replace(">", "\\u003e")
    return f"<!-- t2 checkout {text} -->"


def parse(text: str) -> Report | None:
    """Return the report in a file; None if there is none, or it is of another version."""
    found = RECORD.findall(text)
    try:
        return msgspec.json.decode(found[-1], type=Report) if found else None
    except (ValueError, RecursionError):
        return None


def _head(say: Say, *names: str) -> list[str]:
    return [say(f"report.{name}") for name in names]


def _steps(steps: Sequence[tuple[str, Verdict]], say: Say) -> Iterator[list[str]]:
    """Yield the parts on the steps: one table of all, and one of each step's data."""
    yield [f"## {say('report.steps')}", ""]
    yield _table(
        _head(say, "step", "result", "finding"),
        [(title, say(f"verdict.{each.outcome}"), each.finding) for title, each in steps],
    )
    for title, verdict in steps:
        if verdict.data:
            yield [
                f"### {_cell(title)}",
                "",
                *_table(_head(say, "measured", "value"), _named(verdict.data, say)),
            ]


def _manoeuvres(done: Sequence[tuple[str, Verdict]], say: Say) -> Iterator[list[str]]:
    """Yield the parts on the guided drive: one row a manoeuvre."""
    yield [f"## {say('report.manoeuvres')}", ""]
    rows = []
    for title, verdict in done:
        data = dict(verdict.data)
        figures = (data.get(name, "") for name in COLUMNS)
        rows.append((title, *figures, say(f"verdict.{verdict.outcome}"), verdict.text))
    columns = map(say.figure, COLUMNS)
    yield _table([*_head(say, "manoeuvre"), *columns, *_head(say, "result", "finding")], rows)


def _named(data: Iterable[Row], say: Say) -> list[Row]:
    return [(say.figure(name), value) for name, value in data]


def _headline(report: Report, say: Say) -> str:
    lines = [say("report.passed" if report.passed else "report.not_passed")]
    if report.aborted:
        lines.append(say("report.ended", reason=_cell(report.aborted)))
    if report.missing:
        lines.append(say("missing", titles=tuple(map(_cell, report.missing))))
    if report.left_out:
        lines.append(say("report.partial", names=tuple(report.left_out)))
    return say.sentences(lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(map(_cell, line))} |" for line in lines]


def _cell(text: str) -> str:
    """Return a text with pipes escaped and line breaks removed."""
    return " ".join(text.replace("|", "\\|").split())
