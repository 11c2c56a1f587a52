"""The last few things worth a line: the program's own log and the events of all services.

While the screen is up, standard error is the operator's picture, so the log must not go there.
"""

import threading
import time
from collections import deque
from dataclasses import replace

from common import log
from common.messages import Level
from common.settings import Log, LogLevel
from services.teleop.view import Line

KEPT = 100


class Logbook:
    """Keeps the newest lines; may be written from any thread."""

    def __init__(self) -> None:
        self._lines: deque[Line] = deque(maxlen=KEPT)
        self._lock = threading.Lock()

    def add(self, service: str, level: Level, text: str, t_ns: int | None = None) -> None:
        """Append a line, of now unless its wall clock time is given; a repeated one only moves."""
        line = Line(time.time_ns() if t_ns is None else t_ns, service, level, text)
        with self._lock:
            if self._lines and replace(self._lines[-1], t_ns=line.t_ns) == line:
                self._lines.pop()
            self._lines.append(line)

    def last(self, count: int) -> tuple[Line, ...]:
        """Return the newest lines, the newest last."""
        with self._lock:
            return tuple(self._lines)[-count:]

    def take_log(self, settings: Log) -> None:
        """Let every log line of this process end here and nowhere else."""
        log.redirect(self._keep, settings.level)

    def _keep(self, level: LogLevel, event: str, _: log.Fields) -> None:
        self.add("teleop", "info" if level == "debug" else level, event)
