"""The parts of the container test that need no engine."""

import subprocess
from pathlib import Path

import pytest

from cli.demo.score import Trace
from common import motion
from sim.trace import Command
from verification.containers import __main__ as command
from verification.containers import engine
from verification.containers.stack_fixture import held_run_s, override
from verification.containers.table import Row, markdown

RUN, STOP, BRAKE = motion.Command


def test_without_an_engine_it_says_that_it_did_not_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    assert command.main([]) == 0
    assert capsys.readouterr().out == "compose-test: NOT RUN: there is no docker\n"


def test_an_engine_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(words: list[str], **_: object) -> "subprocess.CompletedProcess[str]":
        return subprocess.CompletedProcess(words, 1, "", "Cannot connect to the Docker daemon")

    monkeypatch.setattr("shutil.which", lambda name: name)
    monkeypatch.setattr("subprocess.run", failing)
    assert engine.missing() == (
        "no Docker engine answers: docker info ended with 1: Cannot connect to the Docker daemon"
    )


def test_settings_become_variables_of_each_container() -> None:
    services = override(["safety.sources.demo.lease=1.5"], Path("/t"))["services"]
    assert isinstance(services, dict)
    assert services["safety"]["environment"] == {"T2__SAFETY__SOURCES__DEMO__LEASE": "1.5"}
    assert services["sim"]["volumes"][0]["source"] == "/t"


def commands(*kinds: tuple[int, motion.Command, float]) -> Trace:
    made = [Command(mono_ns=at, kind=kind, linear=v, angular=0.0) for at, kind, v in kinds]
    return Trace([], made, [])


@pytest.mark.parametrize(
    ("trace", "held_s"),
    [
        (
            commands((1, RUN, 0.3), (2_000_000_001, STOP, 0.0)),
            1.0,
        ),  # held, nothing new came
        (
            commands(
                (1, RUN, 0.3),
                (1_500_000_000, RUN, 0.3),
                (3_000_000_001, BRAKE, 0),
            ),
            2.0,
        ),
        (
            commands((1, STOP, 0.0), (2_000_000_001, RUN, 0.0)),
            0.0,
        ),  # never told to move
    ],
)
def test_how_long_the_board_held_a_command_to_move(trace: Trace, held_s: float) -> None:
    assert held_run_s(trace, 1_000_000_001) == held_s


def test_a_cell_stays_in_its_line() -> None:
    text = markdown([Row("a", "b | c\nd", False, 1.4)])
    assert text.splitlines()[-1] == "| a | b / c d | WRONG | 1 s |"
