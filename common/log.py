"""Structured logs on standard error: readable on a terminal, JSON lines otherwise.

A line is an event in words, with what it is about in fields: ``Logger().warning("link lost",
epoch=2)``. Where the lines of a process go is said once, by ``configure`` or ``hand_to``; without
that they are text.
"""

import atexit
import contextlib
import json
import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import TextIO, TypeAlias

from common.settings import Log, LogLevel

WAITING_MAX = 1000  # lines
LAST_LINES_S = 0.5  # how long the end of a program waits for its last lines
LEVELS: tuple[LogLevel, ...] = ("debug", "info", "warning", "error")
COLOURS = {"debug": 2, "info": 32, "warning": 33, "error": 31}  # of a terminal, by ECMA-48

About: TypeAlias = Mapping[str, object]
Take: TypeAlias = Callable[[LogLevel, str, About], None]


class Logger:
    """Says what happens; each line carries what the logger itself is about, too."""

    def __init__(self, **about: object) -> None:
        self._about = about

    def debug(self, event: str, /, **about: object) -> None:
        """Say what only a developer wants to know."""
        self._say("debug", event, about)

    def info(self, event: str, /, **about: object) -> None:
        """Say what happens in a good life."""
        self._say("info", event, about)

    def warning(self, event: str, /, **about: object) -> None:
        """Say what somebody should look at."""
        self._say("warning", event, about)

    def error(self, event: str, /, **about: object) -> None:
        """Say what has failed."""
        self._say("error", event, about)

    def _say(self, level: LogLevel, event: str, about: About) -> None:
        least, take = _outlet
        if LEVELS.index(level) >= least:
            take(level, event, {**self._about, **about})


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
    terminal = sys.stderr.isatty()
    text = settings.format == "text" or (settings.format == "auto" and terminal)
    coloured = terminal and "NO_COLOR" not in os.environ
    lossy = Lossy(sys.stderr)
    atexit.register(lossy.drain)

    def take(level: LogLevel, event: str, about: About) -> None:
        named = {"service": service, **about}
        # A line and its end in one write: the processes of `t2 up` share one standard error.
        lossy.write(
            as_text(level, event, named, coloured) if text else as_json(level, event, named)
        )

    hand_to(take, settings.level)
    return lossy


def hand_to(take: Take, level: LogLevel) -> None:
    """Hand each line of this level or a graver one to ``take``, in the thread that says it."""
    global _outlet
    _outlet = LEVELS.index(level), take


def as_json(level: LogLevel, event: str, about: About) -> str:
    """Return a line for machines, with its time in UTC."""
    stamp = datetime.now(UTC).replace(tzinfo=None).isoformat(timespec="microseconds")
    line = {**about, "event": event, "level": level, "timestamp": f"{stamp}Z"}
    return f"{json.dumps(line, default=repr)}\n"


def as_text(level: LogLevel, event: str, about: About, coloured: bool = False) -> str:
    """Return a line for people, with the local time."""
    stamp = datetime.now().isoformat(timespec="milliseconds")
    word = f"\x1b[{COLOURS[level]}m{level:7}\x1b[0m" if coloured else f"{level:7}"
    fields = " ".join(f"{name}={_shown(value)}" for name, value in about.items())
    said = event if event.isprintable() else repr(event)
    return f"{stamp} [{word}] {said:30} {fields}".rstrip() + "\n"


def _shown(value: object) -> str:
    if isinstance(value, str) and value.isprintable() and value and not set(value) & set(" ='\""):
        return value
    return repr(value)


def _write_plainly(level: LogLevel, event: str, about: About) -> None:
    sys.stderr.write(as_text(level, event, about))


_outlet: tuple[int, Take] = (0, _write_plainly)
