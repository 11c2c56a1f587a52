"""The shift log's file: ``001-log.jsonl`` beside the recordings of robot 001.

It has the events that the shift log needs, and marks while states of safety arrive. Each line is
appended and synchronized; a line that a power loss has cut is skipped.

A line has the time since the boot of its computer, besides the wall clock: after the clock was set,
the last line of a boot corrects all lines of that boot.
"""

import contextlib
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import msgspec
from msgspec import Meta, Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.recorder import shift
from services.recorder.shift import Identity, Seen, Span
from t2.messages import Event, LogReply, LogRequest

SUFFIX = "-log.jsonl"
SIZE_MAX = 2_000_000  # bytes; then the older half is removed: some thousand events
MARK_NS = 60 * NS_PER_S  # between two marks: a power loss may extend a gap by this
SILENT_NS = 5 * NS_PER_S  # without a state of safety
RATE_MAX = 30  # events of a service in a minute: any member can publish events
EVENT_MAX = 4_000  # bytes; a longer event is kept without its phrases
TOGETHER = 100  # rows with one time, which no page separates
WAITING_MAX = 1_000  # lines that wait for the disk


Nanoseconds = Annotated[int, Meta(ge=0, le=2**62)]


class Line(Struct, omit_defaults=True):
    """A mark or an event; a run is a time in which states of safety arrived."""

    host: int  # identifies the boot of the computer
    since_ns: Nanoseconds  # since boot: the begin of the run; of an event outside of runs, its time
    up_ns: Nanoseconds  # since boot
    t_ns: Nanoseconds  # wall clock
    service: str = ""  # of the event
    event: Event | None = None


_line = msgspec.json.Decoder(Line)


def file_of(folder: Path, robot: str) -> Path:
    """Return the path of a robot's log."""
    return folder / f"{robot}{SUFFIX}"


def robot_of(file: Path) -> str:
    """Return the robot of a log."""
    return file.name.removesuffix(SUFFIX)


def history(
    lines: Iterable[Line], booted_ns: Mapping[int, int] = MappingProxyType({})
) -> tuple[list[Seen], list[Span]]:
    """Return the events, and the times in which states of safety arrived.

    ``booted_ns`` has the wall clock of boots that are known better than by their last lines.
    """
    lines = list(lines)
    wall_ns = {line.host: line.t_ns - line.up_ns for line in lines}  # of boot, by the last line
    wall_ns.update(booted_ns)
    runs: dict[tuple[int, int], int] = {}
    seen: list[Seen] = []
    for line in lines:
        boot_ns, run = wall_ns[line.host], (line.host, line.since_ns)
        if line.event is None or line.up_ns > line.since_ns:  # within a run
            runs[run] = max(runs.get(run, 0), line.up_ns)
        if line.event is not None:
            seen.append(Seen(boot_ns + line.up_ns, line.service, line.event))
    spans = [
        Span(wall_ns[host] + since, wall_ns[host] + until) for (host, since), until in runs.items()
    ]
    return seen, spans


def read_lines(file: Path) -> Iterator[Line]:
    """Yield the lines of a file; raise ``OSError``."""
    for line in file.read_bytes().splitlines():
        with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            yield _line.decode(line)


class ShiftLog:
    """Writes the file of one robot; only ``write`` and ``reply`` raise ``OSError``."""

    def __init__(self, file: Path, robot: str, host: int) -> None:
        self._file, self._robot, self._host = file, robot, host
        self._lines: list[Line] | None = None  # of the file, once it is read
        self._waiting: list[Line] = []  # for the disk
        self._known: set[Identity] | None = None  # events of the file, once it is read
        self._since_ns: int | None = None  # of the run
        self._state_ns = (0, 0)  # the newest state: since boot, and on the wall clock
        self._marked_ns = 0
        self._counts: Counter[str] = Counter()  # events of this minute, by service
        self._cut = 0  # lines that the disk did not take in time

    def update(self, up_ns: int, wall_ns: int) -> None:
        """Note a state of safety: since boot, and on the wall clock."""
        if self._since_ns is None or up_ns - self._state_ns[0] > SILENT_NS:
            self.mark()  # the end of the last run
            self._since_ns, self._marked_ns = up_ns, up_ns - MARK_NS
        self._state_ns = up_ns, wall_ns
        if up_ns - self._marked_ns >= MARK_NS:
            self.mark()

    def mark(self) -> None:
        """Note the newest state of safety as the last one, so far."""
        if self._since_ns is not None:
            self._marked_ns = self._state_ns[0]
            self._add(Line(self._host, self._since_ns, *self._state_ns))

    def take_dropped(self) -> int:
        """Return how many events are not in the log since the last call, once a minute."""
        dropped = sum(max(0, count - RATE_MAX) for count in self._counts.values()) + self._cut
        self._counts.clear()
        self._cut = 0
        return dropped

    def note(self, service: str, event: Event, up_ns: int, wall_ns: int) -> None:
        """Note an event if the log needs it, and does not have it.

        It is received again, and late, after the bus was cut. Its own time counts if it is of this
        computer's clock.
        """
        identity = shift.identity(service, event)
        if not shift.is_logged(service, event) or identity in self._known_events():
            return
        if not shift.is_always_logged(service, event):
            self._counts[service] += 1
            if self._counts[service] > RATE_MAX:
                return
        if event.host == self._host and 0 < event.mono_ns < up_ns:
            up_ns, wall_ns = event.mono_ns, wall_ns - (up_ns - event.mono_ns)
        since_ns = self._since_ns
        if since_ns is None or not since_ns <= up_ns <= self._state_ns[0] + SILENT_NS:
            since_ns = up_ns
        if identity is not None:
            self._known_events().add(identity)
        self._add(Line(self._host, since_ns, up_ns, wall_ns, service, _short(event)))

    def write(self) -> None:
        """Append the waiting lines; lines that the disk refuses wait for the next call."""
        if not self._waiting:
            return
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("ab") as file:
            # A line that a power loss has cut ends here.
            file.write(b"\n" * bool(file.tell()) + _encoded(self._waiting))
            file.flush()
            os.fsync(file.fileno())
            size = file.tell()
        if self._lines is not None:
            self._lines += self._waiting
        self._waiting = []
        if size > SIZE_MAX:
            self._shorten()

    def reply(self, request: LogRequest, now_ns: int, wall_ns: int) -> LogReply:
        """Return the rows until now that are asked for, and all that begin with the last one."""
        lines = [*self._read(), *self._waiting]
        if self._since_ns is not None:
            lines.append(Line(self._host, self._since_ns, *self._state_ns))
        # The clock of now corrects the lines of this boot, too.
        seen, spans = history(lines, {self._host: wall_ns - now_ns})
        rows = shift.rows(
            self._robot, seen, spans, since_ns=request.since_ns or None,
            until_ns=wall_ns, before_ns=request.before_ns, most=request.most + TOGETHER,
        )  # fmt: skip
        end = request.most
        while end < len(rows) and rows[end].t_ns == rows[end - 1].t_ns:
            end += 1
        return LogReply(rows=tuple(rows[:end]), more=len(rows) > end)

    def _read(self) -> list[Line]:
        if self._lines is None:
            self._lines = list(read_lines(self._file)) if self._file.exists() else []
        return self._lines

    def _known_events(self) -> "set[Identity]":
        if self._known is None:
            with contextlib.suppress(OSError):
                self._read()
            lines = self._lines or []
            found = (shift.identity(line.service, line.event) for line in lines if line.event)
            self._known = {each for each in found if each is not None}
        return self._known

    def _add(self, line: Line) -> None:
        if line.event is None:  # the newest mark of a run is enough
            self._waiting = [it for it in self._waiting if it.event or it.since_ns != line.since_ns]
        self._waiting.append(line)
        if len(self._waiting) > WAITING_MAX:
            del self._waiting[0]
            self._cut += 1

    def _shorten(self) -> None:
        """Keep the newest lines, without marks that a later line of the run replaces."""
        lines = self._read()
        last = {(line.host, line.since_ns): line for line in lines}
        kept = [line for line in lines if line.event or line is last[line.host, line.since_ns]]
        while len(_encoded(kept)) > SIZE_MAX // 2:
            del kept[: len(kept) // 10 + 1]
        # The time before the first line that is kept is not recorded any more.
        for line in kept:
            if line.host == kept[0].host:
                line.since_ns = max(line.since_ns, kept[0].up_ns)
        if self._since_ns is not None and kept[0].host == self._host:
            self._since_ns = max(self._since_ns, kept[0].up_ns)
        new = self._file.with_name(f".{self._file.name}.new")
        with new.open("wb") as file:
            file.write(_encoded(kept))
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._file)
        self._lines, self._known = kept, None


def _encoded(lines: Iterable[Line]) -> bytes:
    return b"".join(msgspec.json.encode(line) + b"\n" for line in lines)


def _short(event: Event) -> Event:
    """Return an event without its phrases if it is too long."""
    if len(msgspec.json.encode(event)) <= EVENT_MAX:
        return event
    about = {"cause": event.about.get("cause"), "by": shift.by_of(event)}
    return replace(event, phrases=(), text=shift.cut(event.text, shift.TEXT_MAX), about=about)
