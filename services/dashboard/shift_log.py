"""The shift log on its page: rows of the recorder, in both languages."""

import msgspec
from msgspec import Struct

from common.freshness import NS_PER_S
from common.text import line
from services.dashboard.i18n import Texts, rendered
from t2.log_texts import KINDS
from t2.messages import Level, LogKind, LogReply, LogRow, Refusal

ROWS = 100  # of one answer
CALL_S = 5.0  # wait for it


class LogLine(Struct, frozen=True):
    """A row; times are s on the wall clock."""

    kind: LogKind
    word: Texts  # the kind
    level: Level
    begin: float
    end: float | None
    text: Texts
    recording: str  # name of a file; may be empty


class LogView(Struct, frozen=True):
    """Rows, the newest first, or why there are none."""

    lines: list[LogLine] = []
    before: str = (
        ""  # ns, for the next page; empty: there is none. A number of JavaScript is inexact
    )
    problem: Texts | None = None


def log_view(reply: LogReply) -> bytes:
    """Return rows as JSON."""
    before = str(reply.rows[-1].t_ns) if reply.more and reply.rows else ""
    return msgspec.json.encode(LogView([_line(row) for row in reply.rows], before))


def problem(refusal: Refusal) -> bytes:
    """Return why there are no rows as JSON."""
    return msgspec.json.encode(LogView(problem=rendered(refusal.phrases, refusal.text)))


def _line(row: LogRow) -> LogLine:
    return LogLine(
        kind=row.kind,
        word=Texts(*KINDS[row.kind]),
        level=row.level,
        begin=row.t_ns / NS_PER_S,
        end=row.end_ns / NS_PER_S if row.end_ns else None,
        text=rendered(row.phrases, row.text),
        recording=line(row.recording),
    )
