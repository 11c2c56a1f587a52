"""Structured logs on standard error: readable on a terminal, JSON lines otherwise."""

import atexit
import contextlib
import logging
import os
import queue
import sys
import threading
import time
from typing import TextIO, cast

import structlog

from common.settings import Log

WAITING_MAX = 1000  # lines
LAST_LINES_S = 0.5  # how long the end of a program waits for its last lines


class Lossy:
    """A file that may be gone or not be read: a dead parent's pipe, a terminal after ctrl-S.

    A thread writes, so that a line may be lost and never hold up the service that said it.
    """

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._lines: queue.Queue[str] = queue.Queue(WAITING_MAX)
        self._thread = threading.Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    def write(self, text: str) -> None:
        """Take a line; it is lost when too many wait already."""
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(text)

    def flush(self) -> None:
        """Return at once: the thread passes on each line that it writes."""

    def drain(self, patience_s: float = LAST_LINES_S) -> None:
        """Wait until all lines are written, but no longer than this."""
        deadline_s = time.monotonic() + patience_s
        while self._lines.unfinished_tasks and time.monotonic() < deadline_s:
            time.sleep(0.001)

    def _run(self) -> None:
        while True:
            line = self._lines.get()
            with contextlib.suppress(OSError, ValueError):
                self._pass_on(line)
            self._lines.task_done()

    def _pass_on(self, line: str) -> None:
        try:
            self._file.write(line)
            self._file.flush()
        except BrokenPipeError:
            # Nobody reads any more. Python would write what is left once more on its way out, and
            # make its failure the exit code.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._file.fileno())


def configure(settings: Log, service: str) -> Lossy:
    """Set the level and the form of every line, put the service's name on it; return the file."""
    text = settings.format == "text" or (settings.format == "auto" and sys.stderr.isatty())
    renderer = structlog.dev.ConsoleRenderer() if text else structlog.processors.JSONRenderer()
    lossy = Lossy(sys.stderr)
    atexit.register(lossy.drain)
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=not text),
            _with_service(service),
            structlog.processors.format_exc_info if not text else _unchanged,
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(
            logging.getLevelNamesMapping()[settings.level.upper()]
        ),
        # A line and its end in one write: the processes of `t2 up` share one standard error.
        logger_factory=structlog.WriteLoggerFactory(cast("TextIO", lossy)),
        cache_logger_on_first_use=True,
    )
    return lossy


def _with_service(service: str) -> structlog.typing.Processor:
    def add(_: object, __: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
        return {"service": service, **event}

    return add


def _unchanged(_: object, __: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
    return event
