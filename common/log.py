"""Structured logs on standard error: text on a terminal, JSON lines otherwise.

``Logger().warning("link lost", epoch=2)`` logs an event with fields. It goes through the standard
library's ``logging``, so warnings and errors of libraries arrive in the same form.
"""

import json
import logging
import os
import queue
import sys
import threading
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import partialmethod
from typing import Any, Literal, TextIO, TypeAlias

from common.settings import Log, LogLevel

NAME = "t2"  # of the logger of all our lines; others are of libraries
QUEUE_MAX = 1000  # lines
FLUSH_S = 0.5  # how long the end of a program waits for its last lines

Fields: TypeAlias = Mapping[str, object]
Receiver: TypeAlias = Callable[[LogLevel, str, Fields], None]


class Logger:
    """Logs events with fields; each line carries the logger's own fields, too."""

    def __init__(self, **fields: object) -> None:
        self._fields = fields

    def log(self, level: int, event: str, /, **fields: object) -> None:
        """Log an event of this level."""
        _logger.log(level, event, extra={"fields": {**self._fields, **fields}})

    debug = partialmethod(log, logging.DEBUG)  # what a developer wants to know
    info = partialmethod(log, logging.INFO)  # a normal transition
    warning = partialmethod(log, logging.WARNING)  # what an operator should look at
    error = partialmethod(log, logging.ERROR)  # a failure


class Formatter(logging.Formatter):
    """Returns a line: a JSON object with the time in UTC, or text with the local time."""

    def __init__(self, service: str = "", form: Literal["json", "text"] = "text"):
        super().__init__()
        self._service, self._form = service, form

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, without its end."""
        fields = ({"service": self._service} if self._service else {}) | fields_of(record)
        event, level = record.getMessage(), record.levelname.lower()
        if self._form == "json":
            at = datetime.fromtimestamp(record.created, UTC).replace(tzinfo=None)
            stamp = f"{at.isoformat(timespec='microseconds')}Z"
            line = {**fields, "event": event, "level": level, "timestamp": stamp}
            return json.dumps(line, default=repr)
        at = datetime.fromtimestamp(record.created)
        shown = " ".join(f"{name}={_shown(value)}" for name, value in fields.items())
        event = event if event.isprintable() else repr(event)
        return f"{at.isoformat(timespec='milliseconds')} [{level:7}] {event:30} {shown}".rstrip()


class Output(logging.Handler):
    """Writes lines to a file in a thread of its own, so that no caller waits for it.

    When a dead parent's pipe or a terminal after ctrl-S takes no more lines, lines are lost.
    """

    def __init__(self, file: TextIO, formatter: logging.Formatter) -> None:
        super().__init__()
        self.setFormatter(formatter)
        self._file = file
        # Reentrant: a signal handler may log while its thread logs.
        self._lines: queue.SimpleQueue[logging.LogRecord | threading.Event] = queue.SimpleQueue()
        threading.Thread(target=self._write_lines, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a line, or drop it."""
        if self._lines.qsize() < QUEUE_MAX:
            self._lines.put(record)

    def flush(self) -> None:
        """Wait until all lines are written, or ``FLUSH_S``; ``logging`` calls it at exit."""
        written = threading.Event()
        self._lines.put(written)
        written.wait(FLUSH_S)

    def _write_lines(self) -> None:
        while True:
            line = self._lines.get()
            if isinstance(line, threading.Event):
                line.set()
                continue
            try:
                # With its end at once: the processes of `t2 up` share one standard error.
                self._file.write(f"{self.format(line)}\n")
                self._file.flush()
            except BrokenPipeError:
                # The reader is gone. On exit, Python would write the rest again and fail; that
                # failure would be the exit code.
                os.dup2(os.open(os.devnull, os.O_WRONLY), self._file.fileno())
            except (OSError, ValueError):
                pass  # closed


class Callback(logging.Handler):
    """Passes each line to a function, in the thread that logs it."""

    def __init__(self, receive: Receiver) -> None:
        super().__init__()
        self._receive = receive

    def emit(self, record: logging.LogRecord) -> None:
        """Pass on level, event and fields."""
        level: Any = "error" if record.levelno > logging.ERROR else record.levelname.lower()
        self._receive(level, record.getMessage(), fields_of(record))


def configure(settings: Log, service: str) -> Output:
    """Send lines of the set level to standard error, with the service's name.

    Of libraries, only warnings and errors are logged.
    """
    form = settings.format
    if form == "auto":
        form = "text" if sys.stderr.isatty() else "json"
    output = Output(sys.stderr, Formatter(service, form))
    _install(output, settings.level)
    return output


def redirect(receive: Receiver, level: LogLevel) -> None:
    """Send every line of this level or above to a function instead of standard error."""
    _install(Callback(receive), level)


def fields_of(record: logging.LogRecord) -> dict[str, object]:
    """Return the fields of a line: our own, or the name of the library that logged it."""
    fields = dict(getattr(record, "fields", {} if record.name == NAME else {"logger": record.name}))
    if record.exc_info and record.exc_info[0]:
        fields["exception"] = logging.Formatter().formatException(record.exc_info)
    return fields


def _install(handler: logging.Handler, level: LogLevel) -> None:
    root, least = logging.getLogger(), logging.getLevelNamesMapping()[level.upper()]
    for old in root.handlers[:]:
        if isinstance(old, Output | Callback):
            root.removeHandler(old)
    root.addHandler(handler)
    root.setLevel(max(least, logging.WARNING))
    _logger.setLevel(least)


def _shown(value: object) -> str:
    if isinstance(value, str) and value.isprintable() and value and not set(value) & set(" ='\""):
        return value
    return repr(value)


_logger = logging.getLogger(NAME)
if logging.lastResort:  # before ``configure``: warnings and errors, as text
    logging.lastResort.setFormatter(Formatter())
