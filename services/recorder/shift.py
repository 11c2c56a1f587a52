"""The shift log: stops, take-overs, resets and rounds of one robot, with names, from events. Pure.

============ ========================================== ============================================
row          begins with an event of                    and ends with
============ ========================================== ============================================
``stop``     safety: a latch, or a stop with a warning  the reset that leaves nothing latched
``takeover`` a page or terminal: takes control          –
``reset``    safety, if no stop before it is known      –
``round``    patrol: ``round_start``                    ``round_end``; other events have own rows
``note``     ``NOTES``                                  –
``gap``      the last sign of safety before it          the first one after it
============ ========================================== ============================================

Safety reports that it latched or was reset, and a page or a terminal who asked for it. Both are one
row if they are at most ``AROUND_NS`` apart.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import takewhile
from operator import attrgetter
from typing import NamedTuple

from common.freshness import NS_PER_S
from t2.catalogue import LATCHED, TEXTS
from t2.messages import (
    MAX_TEXT,
    Event,
    EventName,
    Field,
    Level,
    LogKind,
    LogRow,
    Phrase,
    SafetyState,
)
from t2.words import render

AROUND_NS = 3 * NS_PER_S  # between what happened and the event that names who asked for it
GAP_NS = 10 * NS_PER_S  # a shorter gap is a restart
BLACK_BOX_NS = 300 * NS_PER_S  # from a latch to the event of its file, at most
NAME_MAX, TEXT_MAX, PHRASES_MAX = 60, 300, 8  # characters of a name and of a text; phrases of a row
LATCHES = (*LATCHED, "driver_fault")  # events of safety
ROUTINE = ("blocked", "limit_stop")  # stops for an obstacle or a person in the way
ASKED = ("estop", "reset_request")  # events that name who asked
NOTES = (
    "in_sight", "by_picture", "black_box_lost", "disk_full", "log_dropped", "estop_denied",
    "estop_unconfirmed", "reset_unconfirmed",
)  # fmt: skip
ROUNDS = (
    "round_start", "round_end", "round_stopped", "round_blocked", "round_skipped", "round_return",
    "round_paused", "round_resumed",
)  # fmt: skip
CONTROL = ("take", "take_over", "leave")
OPERATED = ("dashboard", "teleop", "estop")  # services whose events name an operator
OF_SERVICE: dict[str, tuple[str, ...]] = {
    "bridge": ("link_lost", "link_up", "board_restarted", "relay_lost"),
    "safety": (*LATCHES, "stop", "reset", "reset_refused"),
    "patrol": ROUNDS,
    "recorder": (*NOTES, "black_box"),
    **dict.fromkeys(OPERATED, (*ASKED, *NOTES, *CONTROL, "round_request")),
}


Identity = tuple[str, str, int, int, int]


class Seen(NamedTuple):
    """An event with its time on the wall clock of the recorder."""

    at_ns: int
    service: str
    event: Event


class Span(NamedTuple):
    """A time in which states of safety were recorded."""

    begin_ns: int
    end_ns: int


@dataclass
class Row:
    """A row that later events may complete."""

    kind: LogKind
    at_ns: int
    phrases: list[Phrase]
    level: Level = "info"
    by: str = ""
    reset_by: str = ""
    end_ns: int = 0
    recording: str = ""
    is_open: bool = False  # a latch that is not reset, a round that is not over
    last_ns: int = 0  # of the latches that are one stop
    causes: dict[str, int] = field(default_factory=dict)  # of these, with their times

    def message(self, robot: str) -> LogRow:
        """Return the row as a message, with cut texts."""
        phrases = list(self.phrases)
        if self.is_open:
            phrases.append(Phrase("log.no_reset" if self.kind == "stop" else "log.no_end"))
        given = tuple(_cut(each) for each in phrases[:PHRASES_MAX])
        return LogRow(
            kind=self.kind, robot=robot, t_ns=self.at_ns, end_ns=self.end_ns, level=self.level,
            by=self.by, reset_by=self.reset_by, recording=self.recording,
            text=render(given)[:MAX_TEXT], phrases=given,
        )  # fmt: skip


def latch(state: SafetyState, cause: str) -> Event:
    """Return an event for a cause that a state has as latched: safety's own one may be lost."""
    found = next((it for it in state.causes if it.name == cause), None)
    fault: EventName = "driver_fault"
    name: EventName = next((each for each in LATCHED if each == cause), fault)
    return Event(
        name=name, level="error", text=found.text if found else cause,
        phrases=found.phrases if found else (), about={"cause": cause},
        boot=state.boot, seq=state.seq, t_ns=state.t_ns,
    )  # fmt: skip


def is_logged(service: str, event: Event) -> bool:
    """Return whether the shift log needs an event."""
    return event.name in OF_SERVICE.get(service, ()) and not _is_routine(event)


def is_always_logged(service: str, event: Event) -> bool:
    """Return whether no number of other events may keep an event out of the log."""
    return service == "safety" and event.name in (*LATCHES, "reset")


def _is_routine(event: Event) -> bool:
    return event.name == "stop" and (event.level == "info" or event.about.get("cause") in ROUTINE)


def rows(
    robot: str,
    seen: Iterable[Seen],
    spans: Iterable[Span],
    *,
    since_ns: int | None = None,
    until_ns: int | None = None,
    before_ns: int | None = None,
    most: int | None = None,
) -> list[LogRow]:
    """Return the newest rows of one robot that begin before a time, the newest first.

    Each event counts once. The times between ``since_ns``, the spans and ``until_ns`` are gaps. A
    row that ends after ``since_ns`` is whole.
    """
    events: dict[tuple[object, ...], Seen] = {}
    for one in seen:
        events.setdefault(identity(one.service, one.event) or (one.service, one.at_ns), one)
    ordered = sorted(events.values(), key=lambda one: one.at_ns)
    found = [*_gaps(spans, since_ns, until_ns), *_Builder(ordered).rows]
    found.sort(key=lambda row: row.at_ns, reverse=True)
    wanted = [
        row
        for row in found
        if (since_ns is None or max(row.at_ns, row.end_ns) >= since_ns)
        and (before_ns is None or row.at_ns < before_ns)
    ]
    return [row.message(robot) for row in wanted[:most]]


def identity(service: str, event: Event) -> Identity | None:
    """Return what an event has in common with itself only; None without a header."""
    return (service, event.name, event.boot, event.seq, event.t_ns) if event.boot else None


def _gaps(spans: Iterable[Span], since_ns: int | None, until_ns: int | None) -> Iterator[Row]:
    ends = [] if until_ns is None else [Span(until_ns, until_ns)]
    last_ns: int | None = None
    for span in [*sorted(spans), *ends]:
        if until_ns is not None and span.begin_ns > until_ns:  # of a wrong clock
            continue
        if last_ns is None:
            last_ns = span.begin_ns if since_ns is None else min(since_ns, span.begin_ns)
        if span.begin_ns - last_ns > GAP_NS:
            yield Row("gap", last_ns, [Phrase("log.gap")], "warning", end_ns=span.begin_ns)
        last_ns = max(last_ns, span.end_ns)


class _Builder:
    """Builds rows from events in the order of their times."""

    def __init__(self, events: list[Seen]) -> None:
        self.rows: list[Row] = []
        self._latched: list[Row] = []  # stops that are not reset
        self._round: Row | None = None  # that is not over
        self._silent: Row | None = None  # of a board that is silent
        people = [each for each in events if each.service in OPERATED]
        self._spent: list[Seen] = []  # requests that safety had carried out already
        self._asked = {name: [it for it in people if it.event.name == name] for name in ASKED}
        for one in events:
            if one.service == "safety":
                self._add_safety(one)
            elif one.service == "patrol":
                self._add_round(one)
            elif one.event.name not in ASKED:
                self._add_other(one)
        kinds: dict[str, LogKind] = {"estop": "stop", "reset_request": "reset"}
        for one in [*self._spent, *(one for asked in self._asked.values() for one in asked)]:
            row = self._add(kinds[one.event.name], one, by=by_of(one.event))
            if not self._was_latched(one.at_ns):
                row.phrases.append(Phrase("log.unconfirmed"))

    def _add(self, kind: LogKind, one: Seen, *before: Phrase, by: str = "") -> Row:
        phrases = [*before, *phrases_of(one.event)]
        self.rows.append(Row(kind, one.at_ns, phrases, one.event.level, by))
        return self.rows[-1]

    def _add_safety(self, one: Seen) -> None:
        name = one.event.name
        if name in LATCHES:
            self._latch(one)
        elif name == "reset":
            self._reset(one)
        elif name == "reset_refused":
            asked = self._who_asked("reset_request", one.at_ns)
            by = [Phrase("log.asked_by", {"who": asked})] if asked else []
            self._add("reset", one, *by, Phrase("log.reset_refused"), by=asked)
        elif not _is_routine(one.event):
            self._add("stop", one)

    def _latch(self, one: Seen) -> None:
        cause = str(one.event.about.get("cause", one.event.name))
        known_ns = [row.causes[cause] for row in self._latched if cause in row.causes]
        if known_ns and one.at_ns - known_ns[-1] <= AROUND_NS:
            return  # known by an event and by a state
        by = self._who_asked("estop", one.at_ns) if one.event.name == "estop" else ""
        phrases = [Phrase("estop.by", {"who": by})] if by else phrases_of(one.event)
        if self._latched and one.at_ns - self._latched[-1].last_ns <= AROUND_NS:
            row = self._latched[-1]
            row.phrases += [each for each in phrases if each not in row.phrases]
            row.by = row.by or by
        else:
            row = Row("stop", one.at_ns, phrases, one.event.level, by, is_open=True)
            self.rows.append(row)
            self._latched.append(row)
        row.last_ns = one.at_ns
        row.causes[cause] = one.at_ns

    def _reset(self, one: Seen) -> None:
        by = self._who_asked("reset_request", one.at_ns)
        phrase = Phrase("log.reset_by", {"who": by}) if by else Phrase("log.reset")
        phrases = phrases_of(one.event)
        is_whole = phrases[0].name == "reset.done"
        if not (is_whole and self._latched):
            rest = [] if is_whole else phrases
            self.rows.append(Row("reset", one.at_ns, [phrase, *rest], by=by, reset_by=by))
            return
        asked = self._asked["estop"]  # again, while it was latched
        self._spent += [each for each in asked if each.at_ns <= one.at_ns]
        self._asked["estop"] = [each for each in asked if each.at_ns > one.at_ns]
        for row in self._latched:
            row.is_open, row.end_ns, row.reset_by = False, one.at_ns, by
            row.phrases.append(phrase)
        self._latched = []

    def _was_latched(self, at_ns: int) -> bool:
        return any(
            row.last_ns and row.at_ns <= at_ns and (row.is_open or at_ns <= row.end_ns)
            for row in self.rows
        )

    def _add_round(self, one: Seen) -> None:
        name, phrases = one.event.name, phrases_of(one.event)
        if name == "round_start":
            route = next((it.fields["route"] for it in phrases if "route" in it.fields), "?")
            phrase = Phrase("log.round", {"route": route})
            self._round = Row("round", one.at_ns, [phrase], is_open=True)
            self.rows.append(self._round)
        elif name == "round_end" and self._round:
            row, self._round = self._round, None
            row.is_open, row.end_ns, row.level = False, one.at_ns, one.event.level
            row.phrases += phrases
        else:
            self._add("round", one)

    def _add_black_box(self, one: Seen) -> None:
        """Name the file at the stops that are in it: of its cause, and later ones."""
        name = str(one.event.about.get("file", "")).rpartition("/")[2][:200]
        stops = [row for row in self.rows if row.last_ns and one.at_ns - row.at_ns <= BLACK_BOX_NS]
        for row in reversed(stops):
            row.recording = row.recording or name
            if any(f"-latch-{cause}." in name for cause in row.causes):
                return

    def _add_other(self, one: Seen) -> None:
        if one.event.name == "black_box":
            self._add_black_box(one)
        elif one.event.name == "link_lost":
            self._silent = self._add("note", one)
        elif one.event.name != "link_up":
            self._add_person(one)
        elif self._silent:
            self._silent.end_ns, self._silent = one.at_ns, None

    def _add_person(self, one: Seen) -> None:
        kinds: dict[str, LogKind] = {
            **dict.fromkeys(CONTROL, "takeover"), "round_request": "round"
        }  # fmt: skip
        action = str(one.event.about.get("action", ""))
        if not action.startswith("teach_"):
            self._add(kinds.get(one.event.name, "note"), one, by=by_of(one.event))

    def _who_asked(self, name: str, at_ns: int) -> str:
        """Return who asked for it; empty if that is not known."""
        asked = self._asked[name]
        first = bisect_left(asked, at_ns - AROUND_NS, key=attrgetter("at_ns"))
        near = takewhile(lambda at: asked[at].at_ns <= at_ns + AROUND_NS, range(first, len(asked)))
        nearest = min(near, key=lambda at: abs(asked[at].at_ns - at_ns), default=None)
        return "" if nearest is None else by_of(asked.pop(nearest).event)


def phrases_of(event: Event) -> list[Phrase]:
    """Return the phrases of an event; its text as a phrase if this version does not know them."""
    is_known = event.phrases and all(phrase.name in TEXTS for phrase in event.phrases)
    return list(event.phrases) if is_known else [Phrase("log.text", {"text": event.text})]


def by_of(event: Event) -> str:
    """Return who asked for it, cut; empty if the event does not name anybody."""
    found = [event.about, *(phrase.fields for phrase in event.phrases)]
    names = [by for fields in found if isinstance(by := fields.get("by"), str)]
    return cut(names[0], NAME_MAX) if names else ""


def cut(text: str, most: int) -> str:
    """Return a text of at most so many characters."""
    return text if len(text) <= most else text[: most - 1] + "…"


def _cut(phrase: Phrase) -> Phrase:
    def short(name: str, value: Field) -> Field:
        limit = NAME_MAX if name in ("by", "other", "who") else TEXT_MAX
        return cut(value, limit) if isinstance(value, str) else value

    return Phrase(phrase.name, {name: short(name, it) for name, it in phrase.fields.items()})
