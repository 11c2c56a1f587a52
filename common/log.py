"""Structured logs on standard error: readable on a terminal, JSON lines otherwise."""

import contextlib
import logging
import sys
from typing import TextIO, cast

import structlog

from common.settings import Log


class Lossy:
    """A file that may be gone, such as the pipe or the terminal of a parent that has died.

    A line is lost then, and never the service that wanted to say it.
    """

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, text: str) -> None:
        """Write, if there is anybody to read."""
        with contextlib.suppress(OSError, ValueError):
            self._file.write(text)

    def flush(self) -> None:
        """Pass on what was written."""
        with contextlib.suppress(OSError, ValueError):
            self._file.flush()


def configure(settings: Log, service: str) -> None:
    """Set the level and the form of every line, and put the service's name on it."""
    text = settings.format == "text" or (settings.format == "auto" and sys.stderr.isatty())
    renderer = structlog.dev.ConsoleRenderer() if text else structlog.processors.JSONRenderer()
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
        logger_factory=structlog.WriteLoggerFactory(cast("TextIO", Lossy(sys.stderr))),
        cache_logger_on_first_use=True,
    )


def _with_service(service: str) -> structlog.typing.Processor:
    def add(_: object, __: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
        return {"service": service, **event}

    return add


def _unchanged(_: object, __: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
    return event
