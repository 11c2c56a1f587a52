"""The event log on the screen: teleop's own log lines and the events of all services.

While the screen is up it owns the terminal, so no log line may go to standard error.
"""

import threading
import time
from collections import deque
from dataclasses import replace

from common import log
from common.messages import Level
from common.settings import Log, LogLevel
from common.text import printable
from common.verdict import MAX_TEXT
from services.teleop.view import Line

CAPACITY = 100
ANSWER_NS = 1_000_000_000  # between the answer to a call and its event


class EventLog:
    """The newest lines; any thread may add one."""

    def __init__(self) -> None:
        self._lines: deque[Line] = deque(maxlen=CAPACITY)
        self._lock = threading.Lock()

    def add(self, service: str, level: Level, text: str, t_ns: int | None = None) -> None:
        """Append a line with its wall clock time, by default now; a repeat replaces the last.

        An answer of safety comes twice, to the call ("reset refused: ...") and as an event.
        """
        text = printable(text)[:MAX_TEXT]
        line = Line(time.time_ns() if t_ns is None else t_ns, printable(service), level, text)
        with self._lock:
            last = self._lines[-1] if self._lines else None
            if last and (last.service, last.level) == (service, level):
                longer, shorter = sorted((last.text, text), key=len, reverse=True)
                is_answer = shorter and abs(line.t_ns - last.t_ns) < ANSWER_NS
                if longer == shorter or (is_answer and longer.endswith(shorter)):
                    self._lines.pop()
                    line = replace(line, text=longer)
            self._lines.append(line)

    def last(self, count: int) -> tuple[Line, ...]:
        """Return the newest lines, the newest last."""
        with self._lock:
            return tuple(self._lines)[-count:]

    def capture_logs(self, settings: Log) -> None:
        """Redirect all log lines of this process to this log only."""
        log.redirect(self._on_log, settings.level)

    def _on_log(self, level: LogLevel, event: str, _: log.Fields) -> None:
        self.add("teleop", "info" if level == "debug" else level, event)
