"""Event log: the newest events of all services and log lines of this program.

While the screen is up it owns the terminal: no log line may go to standard error.
"""

import threading
import time
from dataclasses import dataclass, replace

from common import clock, log
from common.freshness import NS_PER_S
from common.service import Node
from common.settings import Log, LogLevel
from common.text import line, printable
from services.teleop.config import TeleopConfig
from t2.messages import Event, EventName, Field, Level, Phrase, Phrases

LINES = 40  # more than a screen has
HISTORY_NS = 2 * NS_PER_S  # in which all services send theirs


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the events panel."""

    t_ns: int  # wall clock
    service: str
    level: Level
    phrases: Phrases
    text: str  # without phrases, or if this version does not know them
    host: int = 0  # of its sender; 0: unknown
    mono_ns: int = 0  # monotonic clock of this host
    received_ns: int = 0


def said(one: Line) -> tuple[object, ...]:
    """Return what a line says, without its time."""
    return one.service, one.level, one.phrases or one.text


def is_later(one: Line, other: Line) -> bool:
    """Return whether a line of the same history as the other is later."""
    is_old = other.received_ns - one.received_ns > HISTORY_NS
    return not is_old and one.host == other.host and one.mono_ns > other.mono_ns


class EventLog:
    """The newest lines in the order of their arrival; any thread may add one.

    Services send their history to a new reader at once, one service after the other. Events of such
    a burst are ordered by their host's monotonic clock, which all its processes share.
    """

    def __init__(self) -> None:
        self._lines: list[Line] = []
        self._lock = threading.Lock()

    def add(
        self, service: str, level: Level, phrases: Phrases, text: str = "",
        event: Event | None = None,
    ) -> None:  # fmt: skip
        """Append a line, by default with the time of now; a repeat replaces the last.

        An answer of safety comes twice, to the call and as an event.
        """
        t_ns, now_ns = event.t_ns if event else time.time_ns(), clock.now_ns()
        added = Line(t_ns, printable(service), level, phrases, line(text), received_ns=now_ns)
        if event:
            added = replace(added, host=event.host, mono_ns=event.mono_ns)
        with self._lock:
            at = len(self._lines)
            if at and said(self._lines[-1]) == said(added):
                self._lines.pop()
                at -= 1
            while at and added.host and is_later(self._lines[at - 1], added):
                at -= 1
            self._lines.insert(at, added)
            del self._lines[:-LINES]

    def lines(self) -> tuple[Line, ...]:
        """Return the lines, the newest last."""
        with self._lock:
            return tuple(self._lines)

    def capture_logs(self, settings: Log) -> None:
        """Redirect all log lines of this process to this log only."""
        log.redirect(self._on_log, settings.level)

    def _on_log(self, level: LogLevel, event: str, fields: log.Fields) -> None:
        if "event_name" not in fields:  # ``OwnEvents`` adds those with their phrases
            self.add("teleop", "info" if level == "debug" else level, (), event)


class OwnEvents:
    """Publishes the events of this program, and shows them in its own log."""

    def __init__(self, node: Node[TeleopConfig], event_log: EventLog) -> None:
        self._node, self._log = node, event_log

    def __call__(self, name: EventName, level: Level, *phrases: Phrase, **about: Field) -> None:
        """Publish an event; without phrases it has the text of its name."""
        self._node.event(name, level, *phrases, **about)
        self._log.add("teleop", level, phrases or (Phrase(f"event.{name}", about),))

    def note(self, level: Level, *phrases: Phrase) -> None:
        """Show a line on this screen only."""
        self._log.add("teleop", level, phrases)
