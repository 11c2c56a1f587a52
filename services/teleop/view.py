"""What the screen shows: made in the loop's thread, drawn in another.

While the screen is up it owns the terminal: no log line may go to standard error. Log lines and
the events of all services go to the event log.
"""

import threading
import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from common import log
from common.bus.bus import Arrival, Bus
from common.freshness import Latest, fresh
from common.keys import Topic
from common.messages import (
    Bumper,
    Direction,
    Driver,
    Level,
    Link,
    Message,
    Odometry,
    SafetyState,
    Ultrasonic,
    Velocity,
)
from common.motion import Twist
from common.settings import Log, LogLevel
from common.text import printable
from common.verdict import MAX_TEXT

LINES = 40  # of the event log: more than a screen has
ANSWER_NS = 1_000_000_000  # between the answer to a call and its event

M = TypeVar("M", bound=Message)


class LatestTopic(Generic[M]):
    """The newest message of a topic, until it is too old to show."""

    def __init__(self, bus: Bus, topic: Topic[M], max_age_s: float, side: str = "") -> None:
        self._latest: Latest[M] | None = None
        self._max_age_s = max_age_s
        bus.subscribe(topic, self._on_message, side=side)

    def at(self, now_ns: int) -> M | None:
        """Return the message, or None once it is too old."""
        latest = self._latest
        return latest.value if latest and fresh(latest, now_ns, self._max_age_s) else None

    def _on_message(self, arrival: Arrival[M]) -> None:
        self._latest = Latest(arrival.message, arrival.received_ns)


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
    alarm: str = ""  # what the operator must know first
    gear: int
    turbo: bool
    top: Twist  # of full deflection in this gear
    requested: Twist | None = None  # None: silent
    release: Direction | None = None  # direction of the release that the operator holds
    keys_refused: str = ""  # why keys are refused
    gamepad: str = ""  # its status
    move_stick: bool = False  # the gamepad drives and sent no event for a while
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

        An answer of safety comes twice, to the call ("reset refused: ...") and as an event.
        """
        text = printable(text)[:MAX_TEXT]
        line = Line(time.time_ns() if t_ns is None else t_ns, printable(service), level, text)
        with self._lock:
            last = self._lines[-1] if self._lines else None
            if last and (last.service, last.level) == (line.service, level):
                longer, shorter = sorted((last.text, text), key=len, reverse=True)
                is_answer = shorter and line.t_ns - last.t_ns < ANSWER_NS
                if longer == shorter or (is_answer and longer.endswith(shorter)):
                    self._lines.pop()
                    line = replace(line, text=longer)
            self._lines.append(line)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines, the newest last."""
        with self._lock:
            return tuple(self._lines)

    def capture_logs(self, settings: Log) -> None:
        """Redirect all log lines of this process to this log only."""
        log.redirect(self._on_log, settings.level)

    def _on_log(self, level: LogLevel, event: str, _: log.Fields) -> None:
        self.add("teleop", "info" if level == "debug" else level, event)
