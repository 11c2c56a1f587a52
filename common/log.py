"""Structured logs on standard error: text on a terminal, JSON lines otherwise.

``Logger().warning("link lost", epoch=2)`` logs an event with fields. It goes through the standard
library's ``logging``, so warnings and errors of libraries arrive in the same form. ``configure``
puts a queue between the callers and standard error: when a dead parent's pipe or a terminal after
ctrl-S takes no more lines, lines are lost and the service goes on.
"""

import atexit
import contextlib
import json
import logging
import os
import queue
import sys
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from logging.handlers import QueueHandler, QueueListener
from typing import Any, TextIO, TypeAlias

from common.settings import Log, LogLevel

# What no line shows need not be collected for each.
logging.logThreads = logging.logProcesses = logging.logMultiprocessing = False

NAME = "t2"  # of the logger of all our lines; others are of libraries
QUEUE_MAX = 1000  # lines
DRAIN_S = 0.5  # how long the end of a program waits for its last lines
COLOURS = {"debug": 2, "info": 32, "warning": 33, "error": 31}  # of a terminal, by ECMA-48

Fields: TypeAlias = Mapping[str, object]
Receiver: TypeAlias = Callable[[LogLevel, str, Fields], None]


class Logger:
    """Logs events with fields; each line carries the logger's own fields, too."""

    def __init__(self, **fields: object) -> None:
        self._fields = fields

    def debug(self, event: str, /, **fields: object) -> None:
        """Log what a developer wants to know."""
        self._log(logging.DEBUG, event, fields)

    def info(self, event: str, /, **fields: object) -> None:
        """Log a normal transition."""
        self._log(logging.INFO, event, fields)

    def warning(self, event: str, /, **fields: object) -> None:
        """Log what an operator should look at."""
        self._log(logging.WARNING, event, fields)

    def error(self, event: str, /, **fields: object) -> None:
        """Log a failure."""
        self._log(logging.ERROR, event, fields)

    def _log(self, level: int, event: str, fields: Fields) -> None:
        _logger.log(level, event, extra={"fields": {**self._fields, **fields}})


class JsonFormatter(logging.Formatter):
    """One JSON object a line, with the time in UTC."""

    def __init__(self, service: str) -> None:
        super().__init__()
        self._service = service

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, without its end."""
        at = datetime.fromtimestamp(record.created, UTC).replace(tzinfo=None)
        line = {
            "service": self._service,
            **fields_of(record),
            "event": record.getMessage(),
            "level": record.levelname.lower(),
            "timestamp": f"{at.isoformat(timespec='microseconds')}Z",
        }
        return json.dumps(line, default=repr)


class TextFormatter(logging.Formatter):
    """A line for people, with the local time."""

    def __init__(self, service: str = "", *, coloured: bool = False) -> None:
        super().__init__()
        self._service, self._coloured = service, coloured

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, without its end."""
        at = datetime.fromtimestamp(record.created).isoformat(timespec="milliseconds")
        level = record.levelname.lower()
        colour = COLOURS.get(level, COLOURS["error"])
        word = f"\x1b[{colour}m{level:7}\x1b[0m" if self._coloured else f"{level:7}"
        named = fields_of(record)
        if self._service:
            named = {"service": self._service, **named}
        fields = " ".join(f"{name}={_shown(value)}" for name, value in named.items())
        event = record.getMessage()
        return f"{at} [{word}] {event if event.isprintable() else repr(event):30} {fields}".rstrip()


class Output(logging.Handler):
    """Writes to a file that may be closed or blocked; only the queue's thread uses it."""

    def __init__(self, file: TextIO) -> None:
        super().__init__()
        self._file = file

    def createLock(self) -> None:  # noqa: N802 - logging's name
        """Take no lock: ``logging`` would wait for it at exit while a write blocks."""
        self.lock = None

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line and its end at once: the processes of `t2 up` share one standard error."""
        with contextlib.suppress(OSError, ValueError):
            self._write(f"{self.format(record)}\n")

    def _write(self, line: str) -> None:
        try:
            self._file.write(line)
            self._file.flush()
        except BrokenPipeError:
            # The reader is gone. On exit, Python would write the rest again and fail; that failure
            # would be the exit code.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._file.fileno())


class LossyQueue(QueueHandler):
    """Queue of lines on their way to a file: a line is lost when too many wait."""

    def __init__(self, file: TextIO, formatter: logging.Formatter) -> None:
        self._lines: queue.Queue[logging.LogRecord] = queue.Queue(QUEUE_MAX)
        super().__init__(self._lines)
        output = Output(file)
        output.setFormatter(formatter)
        QueueListener(self._lines, output).start()

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        """Return the record as it is: the queue's thread formats it."""
        return record

    def enqueue(self, record: logging.LogRecord) -> None:
        """Append a record, or drop it."""
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(record)

    def drain(self, patience_s: float = DRAIN_S) -> None:
        """Wait until all lines are written, at most this long."""
        deadline_s = time.monotonic() + patience_s
        while self._lines.unfinished_tasks and time.monotonic() < deadline_s:
            time.sleep(0.001)


class Callback(logging.Handler):
    """Passes each line to a function, in the thread that logs it."""

    def __init__(self, receive: Receiver) -> None:
        super().__init__()
        self._receive = receive

    def emit(self, record: logging.LogRecord) -> None:
        """Pass on level, event and fields."""
        level: Any = "error" if record.levelno > logging.ERROR else record.levelname.lower()
        self._receive(level, record.getMessage(), fields_of(record))


def configure(settings: Log, service: str) -> LossyQueue:
    """Send lines of the set level to standard error, with the service's name; return their queue.

    Of libraries, only warnings and errors are logged.
    """
    terminal = sys.stderr.isatty()
    text = settings.format == "text" or (settings.format == "auto" and terminal)
    coloured = terminal and "NO_COLOR" not in os.environ
    lines = LossyQueue(
        sys.stderr, TextFormatter(service, coloured=coloured) if text else JsonFormatter(service)
    )
    atexit.register(lines.drain)
    _install(lines, settings.level)
    return lines


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
        if isinstance(old, LossyQueue | Callback):
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
    logging.lastResort.setFormatter(TextFormatter())
