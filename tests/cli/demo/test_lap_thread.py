"""The thread of the lap: connecting, ends, errors and the timeout."""

import threading
from argparse import Namespace
from pathlib import Path
from typing import Any

import pytest

import t2
from cli.demo import command, lap_thread
from cli.demo.driver import Driver, connected
from cli.demo.lap_thread import LapThread
from cli.demo.record import LapRecord


class Robot:
    """A robot that can only be closed."""

    def __init__(self) -> None:
        self.closed = threading.Event()

    def __enter__(self) -> "Robot":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.closed.set()


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Robot:
    made = Robot()
    monkeypatch.setattr(lap_thread, "connected", lambda *_: made)
    monkeypatch.setattr(LapRecord, "subscribe", lambda *_: None)
    return made


def started(program: Any) -> tuple[LapThread, LapRecord]:
    record = LapRecord()
    lap = LapThread(program, record, "001", "tcp/127.0.0.1:1")
    return lap, record


def test_a_program_that_returns_has_finished(robot: Robot) -> None:
    lap, record = started(lambda _: None)
    lap.start()
    lap.join(20)
    lap.end()
    assert record.finished
    assert robot.closed.is_set()


def test_an_error_of_the_program_is_raised_at_the_end(robot: Robot) -> None:
    def program(_: Driver) -> None:
        raise ValueError("a bug")

    lap, record = started(program)
    lap.start()
    lap.join(20)
    with pytest.raises(ValueError, match="a bug"):
        lap.end()
    assert not record.finished
    assert robot.closed.is_set()


def test_the_timeout_closes_the_robot_and_its_errors_are_expected(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def program(_: Driver) -> None:
        assert robot.closed.wait(20)
        raise RuntimeError("the session is closed")

    monkeypatch.setattr(command, "TIMEOUT_S", 0.0)
    monkeypatch.setattr(command, "traced", lambda _: [])
    lap, record = started(program)
    assert command.drive(Namespace(out=tmp_path), lap, lambda: None) == 0
    assert not lap.is_alive()
    assert not record.finished


def test_connecting_is_repeated_until_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    ended, attempts = threading.Event(), []

    def connect(*_: object, **__: object) -> t2.Robot:
        attempts.append(1)
        if len(attempts) == 3:
            ended.set()
        raise t2.LinkError("no router")

    monkeypatch.setattr(t2, "connect", connect)
    with pytest.raises(t2.LinkError):
        connected("001", "tcp/127.0.0.1:1", ended)
    assert len(attempts) == 3
