"""Log output on standard error and its format."""

import contextlib
import io
import json
import logging
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TextIO

import pytest

from common import log
from common.settings import Log
from verification.harness.waiting import wait_until


class Screen(io.StringIO):
    """A standard error that is a terminal or not."""

    def __init__(self, tty: bool) -> None:
        super().__init__()
        self._tty = tty

    def isatty(self) -> bool:
        return self._tty


def written(
    monkeypatch: pytest.MonkeyPatch,
    settings: Log,
    level: str = "warning",
    *,
    tty: bool = False,
    library: str = "",
) -> str:
    """Return what one line of ours, or of a library, looks like on standard error."""
    screen = Screen(tty)
    monkeypatch.setattr(sys, "stderr", screen)
    output = log.configure(settings, "bridge")
    if library:
        getattr(logging.getLogger(library), level)("%d connections", 3)
    else:
        getattr(log.Logger(), level)("link lost", epoch=2)
    output.flush()
    return screen.getvalue()


def record(level: int, event: str, **fields: object) -> logging.LogRecord:
    made = logging.LogRecord(log.NAME, level, "file", 1, event, None, None)
    made.fields = fields
    return made


@pytest.mark.parametrize(
    ("form", "tty", "text"),
    [("auto", False, False), ("json", True, False), ("auto", True, True), ("text", False, True)],
)
def test_a_terminal_gets_text_and_a_file_json(
    monkeypatch: pytest.MonkeyPatch, form: str, tty: bool, text: bool
) -> None:
    line = written(monkeypatch, Log(format=form), tty=tty)  # type: ignore[arg-type]
    if text:
        assert re.search(r"link lost +service=bridge epoch=2\n$", line)
        return
    entry = json.loads(line)
    assert line.endswith("}\n")
    assert entry.pop("timestamp").endswith("Z")
    assert entry == {"service": "bridge", "event": "link lost", "level": "warning", "epoch": 2}


@pytest.mark.parametrize(
    ("level", "given", "library", "shown"),
    [
        ("info", "debug", "", False),
        ("info", "info", "", True),
        ("debug", "debug", "", True),
        ("debug", "info", "uvicorn.error", False),
        ("debug", "warning", "uvicorn.error", True),
    ],
)
def test_the_level_decides_and_of_libraries_warnings_count(
    monkeypatch: pytest.MonkeyPatch, level: str, given: str, library: str, shown: bool
) -> None:
    line = written(monkeypatch, Log(level=level), given, library=library)  # type: ignore[arg-type]
    assert bool(line) is shown
    if library and shown:
        entry = json.loads(line)
        assert (entry["event"], entry["logger"]) == ("3 connections", "uvicorn.error")
        assert entry["service"] == "bridge"


def test_each_format_holds_every_value() -> None:
    line = log.Formatter("up", "json").format(record(logging.INFO, "Größe × 2 %s", at=Path("a")))
    assert json.loads(line) | {"timestamp": ""} == {
        "service": "up", "event": "Größe × 2 %s", "level": "info", "at": repr(Path("a")),
        "timestamp": "",
    }  # fmt: skip
    made = record(logging.ERROR, "ended", code=1, why="no room", world="")
    stamp, line = log.Formatter("up").format(made).split(" ", 1)
    assert datetime.fromisoformat(stamp).tzinfo is None
    assert line == "[error  ] ended" + 26 * " " + "service=up code=1 why='no room' world=''"
    assert "'a\\x1b[2J'" in log.Formatter("up").format(record(logging.INFO, "a\x1b[2J"))


@pytest.mark.parametrize(
    ("configured", "shown"),
    [
        ("", r"\[warning\] early +epoch=2\n$"),
        ("log.configure(Log(), 'up'); ", r'"epoch": 2, .*}\n$'),
    ],
)
def test_the_last_line_of_a_program_is_written(configured: str, shown: str) -> None:
    imports = "from common import log; from common.settings import Log; "
    code = f"{imports}{configured}log.Logger().warning('early', epoch=2)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert re.search(shown, done.stderr)
    assert not done.stdout


@pytest.fixture
def pipe() -> Iterator[tuple[int, TextIO]]:
    """A pipe: the end to read from, and a file on the other."""
    out, into = os.pipe()
    file = os.fdopen(into, "w")
    yield out, file
    with contextlib.suppress(OSError):
        os.close(out)
    with contextlib.suppress(BrokenPipeError):
        file.close()


def test_a_file_that_nobody_reads_delays_no_caller(pipe: tuple[int, TextIO]) -> None:
    done = threading.Event()
    output = log.Output(pipe[1], logging.Formatter())

    def log_much() -> None:
        for _ in range(10 * log.QUEUE_MAX):
            output.handle(record(logging.INFO, "x" * 100))
        assert output._lines.qsize() <= log.QUEUE_MAX
        output.flush()
        done.set()

    threading.Thread(target=log_much, daemon=True).start()
    wait_until(done.is_set, "the end, though the pipe is full")
    os.close(pipe[0])
    output.flush()  # before its file is closed


def test_a_file_that_is_gone_loses_lines_only(pipe: tuple[int, TextIO]) -> None:
    os.close(pipe[0])
    output = log.Output(pipe[1], logging.Formatter())
    for text in ("nobody reads this", "nor this"):
        output.handle(record(logging.INFO, text))
        output.flush()
    assert not pipe[1].closed
    pipe[1].flush()  # as Python does on exit: an error here would change the exit code
