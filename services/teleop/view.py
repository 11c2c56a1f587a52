"""What the screen shows: made in the loop's thread, drawn in another.

While the screen is up it owns the terminal: no log line may go to standard error. Log lines and
the events of all services go to the event log.
"""

import threading
import time
from collections import deque
from dataclasses import dataclass, replace

from common import log
from common.messages import (
    Bumper,
    Drive,
    Driver,
    Level,
    Link,
    Odometry,
    SafetyState,
    Ultrasonic,
    Velocity,
)
from common.motion import Twist
from common.settings import Log, LogLevel
from common.text import line, printable

LINES = 40  # of the event log: more than a screen has


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the events panel."""

    t_ns: int  # wall clock
    service: str
    level: Level
    text: str


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


class EventLog:
    """The newest lines; any thread may add one."""

    def __init__(self) -> None:
        self._lines: deque[Line] = deque(maxlen=LINES)
        self._lock = threading.Lock()

    def add(self, service: str, level: Level, text: str, t_ns: int | None = None) -> None:
        """Append a line with its wall clock time, by default now; a repeat replaces the last.

        An answer of safety comes twice, to the call and as an event.
        """
        t_ns = time.time_ns() if t_ns is None else t_ns
        added = Line(t_ns, printable(service), level, line(text))
        with self._lock:
            if self._lines and replace(self._lines[-1], t_ns=t_ns) == added:
                self._lines.pop()
            self._lines.append(added)
            if len(self._lines) > 1 and self._lines[-2].t_ns > t_ns:  # history of another service
                self._lines = deque(sorted(self._lines, key=lambda each: each.t_ns), LINES)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines, the newest last."""
        with self._lock:
            return tuple(self._lines)

    def capture_logs(self, settings: Log) -> None:
        """Redirect all log lines of this process to this log only."""
        log.redirect(self._on_log, settings.level)

    def _on_log(self, level: LogLevel, event: str, _: log.Fields) -> None:
        self.add("teleop", "info" if level == "debug" else level, event)
