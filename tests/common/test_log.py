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
from verification.harness.bus import Lines
from verification.harness.waiting import PATIENCE_S, wait_until


class Screen(io.StringIO):
    """A standard error that is a terminal or not."""

    def __init__(self, tty: bool) -> None:
        super().__init__()
        self._tty = tty

    def isatty(self) -> bool:
        return self._tty


def written(
    monkeypatch: pytest.MonkeyPatch, settings: Log, *, tty: bool, level: str = "warning"
) -> str:
    screen = Screen(tty)
    monkeypatch.setattr(sys, "stderr", screen)
    lines = log.configure(settings, "bridge")
    getattr(log.Logger(), level)("link lost", epoch=2)
    lines.drain(PATIENCE_S)
    return screen.getvalue()


@pytest.mark.parametrize(
    ("settings", "tty"), [(Log(), False), (Log(format="json"), True)], ids=["auto", "asked for"]
)
def test_json_is_one_object_a_line(
    monkeypatch: pytest.MonkeyPatch, settings: Log, tty: bool
) -> None:
    line = written(monkeypatch, settings, tty=tty)
    assert line.endswith("}\n")
    entry = json.loads(line)
    assert entry.pop("timestamp").endswith("Z")
    assert entry == {"service": "bridge", "event": "link lost", "level": "warning", "epoch": 2}


@pytest.mark.parametrize(
    ("settings", "tty"), [(Log(), True), (Log(format="text"), False)], ids=["auto", "asked for"]
)
def test_text_is_readable(monkeypatch: pytest.MonkeyPatch, settings: Log, tty: bool) -> None:
    line = written(monkeypatch, settings, tty=tty)
    assert "link lost" in line
    assert "bridge" in line
    assert not line.startswith("{")


@pytest.mark.parametrize(
    ("level", "given", "shown"),
    [
        ("info", "debug", False),
        ("info", "info", True),
        ("error", "warning", False),
        ("error", "error", True),
        ("debug", "debug", True),
    ],
)
def test_the_level_decides(
    monkeypatch: pytest.MonkeyPatch, level: str, given: str, shown: bool
) -> None:
    settings = Log(level=level)  # type: ignore[arg-type]
    assert bool(written(monkeypatch, settings, tty=False, level=given)) is shown


def record(level: int, event: str, **fields: object) -> logging.LogRecord:
    made = logging.LogRecord(log.NAME, level, "file", 1, event, None, None)
    made.fields = fields
    return made


def test_what_json_cannot_hold_is_written_as_its_repr() -> None:
    line = log.JsonFormatter("up").format(
        record(logging.INFO, "Größe × 2 %s", at=Path("a"), values=(1, None))
    )
    entry = json.loads(line)
    assert (entry["event"], entry["at"]) == ("Größe × 2 %s", repr(Path("a")))
    assert entry["values"] == [1, None]


def test_the_text_holds_the_fields() -> None:
    made = record(logging.ERROR, "ended", code=1, why="no room", world="")
    stamp, line = log.TextFormatter("up").format(made).split(" ", 1)
    assert datetime.fromisoformat(stamp).tzinfo is None
    assert line == "[error  ] ended" + 26 * " " + "service=up code=1 why='no room' world=''"


def test_an_event_that_is_not_printable_is_written_as_its_repr() -> None:
    line = log.TextFormatter("up").format(record(logging.INFO, "a\x1b[2J"))
    assert "'a\\x1b[2J'" in line


@pytest.mark.parametrize(("level", "shown"), [("info", False), ("warning", True), ("error", True)])
def test_lines_of_libraries_arrive_from_warnings_on(
    monkeypatch: pytest.MonkeyPatch, level: str, shown: bool
) -> None:
    screen = Screen(tty=False)
    monkeypatch.setattr(sys, "stderr", screen)
    lines = log.configure(Log(level="debug"), "dashboard")
    getattr(logging.getLogger("uvicorn.error"), level)("%d connections", 3)
    lines.drain(PATIENCE_S)
    assert bool(screen.getvalue()) is shown
    if shown:
        entry = json.loads(screen.getvalue())
        assert entry["service"] == "dashboard"
        assert (entry["event"], entry["logger"]) == ("3 connections", "uvicorn.error")


def test_an_exception_is_one_field_of_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(tty=False)
    monkeypatch.setattr(sys, "stderr", screen)
    lines = log.configure(Log(), "dashboard")
    try:
        raise ValueError("broken")
    except ValueError:
        logging.getLogger("asyncio").exception("Task failed")
    lines.drain(PATIENCE_S)
    assert json.loads(screen.getvalue())["exception"].endswith("ValueError: broken")


@pytest.mark.parametrize(("refused", "coloured"), [(False, True), (True, False)])
def test_a_terminal_shows_the_level_in_colour(
    monkeypatch: pytest.MonkeyPatch, refused: bool, coloured: bool
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    if refused:
        monkeypatch.setenv("NO_COLOR", "1")
    line = written(monkeypatch, Log(), tty=True)
    assert ("\x1b[33mwarning\x1b[0m" in line) is coloured
    assert "\x1b" not in written(monkeypatch, Log(format="text"), tty=False)


def test_a_logger_says_what_it_is_about_itself(lines: Lines) -> None:
    log.Logger(robot="007").info("stopped", asked_by="hall")
    assert lines == [("info", "stopped", {"robot": "007", "asked_by": "hall"})]


def test_before_it_is_configured_warnings_are_text_on_standard_error() -> None:
    code = "from common.log import Logger; Logger().warning('early', epoch=2)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert re.search(r"\[warning\] early +epoch=2\n$", done.stderr)
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


def test_a_file_that_nobody_reads_holds_up_nobody(pipe: tuple[int, TextIO]) -> None:
    said = threading.Event()

    def say() -> None:
        lines = log.LossyQueue(pipe[1], logging.Formatter())
        for _ in range(10 * log.QUEUE_MAX):
            lines.handle(record(logging.INFO, "x" * 100))
        lines.drain(0.0)
        said.set()

    threading.Thread(target=say, daemon=True).start()
    wait_until(said.is_set, "all is said, though the pipe is full")


def test_a_file_that_is_gone_loses_lines_only(pipe: tuple[int, TextIO]) -> None:
    os.close(pipe[0])
    lines = log.LossyQueue(pipe[1], logging.Formatter())
    lines.handle(record(logging.INFO, "nobody reads this"))
    lines.drain(PATIENCE_S)
    lines.handle(record(logging.INFO, "nor this"))
    lines.drain(PATIENCE_S)
    assert not pipe[1].closed
    pipe[1].flush()  # as Python does on exit: an error here would change the exit code
