"""What the screen shows: made in the loop's thread, drawn in another.

While the screen is up it owns the terminal: no log line may go to standard error. Log lines and
the events of all services go to the event log.
"""

import threading
import time
from dataclasses import dataclass, replace

from common import clock, log
from common.freshness import NS_PER_S
from common.motion import Twist
from common.settings import Log, LogLevel
from common.text import line, printable
from t2.messages import (
    Bumper,
    Drive,
    Driver,
    Event,
    Level,
    Link,
    Odometry,
    SafetyState,
    Ultrasonic,
    Velocity,
)

LINES = 40  # of the event log: more than a screen has
HISTORY_NS = 2 * NS_PER_S  # in which all services send theirs


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the events panel."""

    t_ns: int  # wall clock
    service: str
    level: Level
    text: str
    host: int = 0  # of its sender; 0: unknown
    mono_ns: int = 0  # monotonic clock of this host
    received_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Everything on the screen; None for values without a fresh message."""

    robot: str
    source: str
    connected: bool  # to a router
    router: str = ""  # its endpoints
    doctor: str = "`t2 doctor`"  # with the options of this program
    may_drive: bool = True
    may_stop: bool = True
    alarm: str = ""  # what the operator must know first
    gear: int
    top: Twist  # of full deflection in this gear
    requested: Drive | None = None  # None: silent
    keys_refused: str = ""  # why keys are refused
    key_notice: str = ""  # of a key without a function
    keys_muted: bool = False  # until they were released
    gamepad: str = ""  # its status
    gamepad_notice: str = ""  # what the operator must do with it
    safety: SafetyState | None = None
    velocity: Velocity | None = None
    odometry: Odometry | None = None
    ultrasonic: Ultrasonic | None = None
    bumper: Bumper | None = None
    link: Link | None = None
    left: Driver | None = None
    right: Driver | None = None
    lines: tuple[Line, ...] = ()  # the newest last


def said(one: Line) -> tuple[str, ...]:
    """Return what a line says, without its time."""
    return one.service, one.level, one.text


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

    def add(self, service: str, level: Level, text: str, event: Event | None = None) -> None:
        """Append a line, by default with the time of now; a repeat replaces the last.

        An answer of safety comes twice, to the call and as an event.
        """
        t_ns = event.t_ns if event else time.time_ns()
        added = Line(t_ns, printable(service), level, line(text), received_ns=clock.now_ns())
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

    def _on_log(self, level: LogLevel, event: str, _: log.Fields) -> None:
        self.add("teleop", "info" if level == "debug" else level, event)
