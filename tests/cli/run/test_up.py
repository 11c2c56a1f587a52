"""``t2 up`` as a process: start, restart of killed services, and clean exit."""

import os
import signal
from argparse import Namespace
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.run import up
from cli.run.up import commands, selected
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.errors import ConfigError
from tests.cli.processes import PATIENCE_S, children, ran, running, sets, t2, wait_gone
from tests.cli.stack import STACK, ports, starts
from verification.harness.waiting import wait_until


def test_a_second_stack_starts_nothing_and_killed_services_start_again(tmp_path: Path) -> None:
    log = tmp_path / "log"
    words = sets(*ports(), "log.format=json", f"recorder.folder={tmp_path}")
    with running(t2("up", *words), log) as up:
        wait_until(lambda: all(starts(log, name) for name in STACK), "all six", PATIENCE_S)
        first = children(up.pid)
        assert set(first) == STACK

        # A second stack starts nothing.
        for more in ([], ["--no-router"]):
            second_up = ran("up", *words, *more)
            assert second_up.returncode == EXIT_LINK
            assert "used by another program; is a stack already running?" in second_up.stderr
            assert "started" not in second_up.stderr

        # The ports of the killed router and bridge are bound again.
        for victim in ("router", "bridge"):
            os.kill(first[victim], signal.SIGKILL)
        wait_until(lambda: starts(log, "router") == starts(log, "bridge") == 2, "both", PATIENCE_S)
        second = children(up.pid)
        assert set(second) == STACK
        changed = {name for name in STACK if first[name] != second[name]}
        assert changed == {"router", "bridge"}
        assert log.read_text().count("ended, starts again") == 2

        up.send_signal(signal.SIGINT)
        assert up.wait(PATIENCE_S) == 0
        wait_gone(list(second.values()))
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (sets("board.port=0"), "board.port = 0"),
        (["--profile", "moon"], "known profiles are"),
        (["--profile", "slope", "--no-sim"], "leave --no-sim or --profile out"),
    ],
)
def test_an_invalid_setting_starts_nothing(
    words: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delattr("cli.run.up.Supervisor")
    assert main(["up", *words]) == EXIT_CONFIG
    error = capsys.readouterr().err
    assert error.startswith("t2 up: ")
    assert message in error


# --- commands ---------------------------------------------------------------------------------


def options(**given: object) -> Namespace:
    return Namespace(**({"no_sim": False, "world": None, "config": None, "sets": []} | given))


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({}, ["router", "sim", "bridge", "safety", "odom"]),
        ({"no_sim": True, "world": "office"}, ["router", "bridge", "safety", "odom"]),
        ({"no_router": True}, ["sim", "bridge", "safety", "odom"]),
    ],
)
def test_processes_in_order_of_dependency(given: dict[str, object], names: list[str]) -> None:
    assert [name for name, _ in commands(options(**given))] == names


def test_settings_sources_are_passed_to_all_processes() -> None:
    files = [Path("a.toml"), Path("b.toml")]
    made = dict(commands(options(config=files, sets=["robot.id=2", "log.level=debug"], world="x")))
    passed = ["--config", "a.toml", "--config", "b.toml"]
    passed += sets("robot.id=2", "log.level=debug")
    for name, command in made.items():
        assert command[-len(passed) :] == passed, name
    assert " ".join(made["sim"][1:6]) == "-P -m sim --world x"
    assert " ".join(made["router"][1:5]) == "-P -m cli router"


def test_the_gateway_only_if_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert up.ros2(options(ros2=False)) == []
    ((name, command),) = up.ros2(options(ros2=True, sets=["ros2.domain=3"]))
    assert name == "ros2"
    assert " ".join(command[1:]) == "-P -m services.ros2 --set ros2.domain=3"
    monkeypatch.setattr(up, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match="--ros2 needs xxhash: install the extra `ros2`"):
        up.ros2(options(ros2=True))


def test_only_one_process() -> None:
    everything = commands(options())
    assert selected(everything, None) == everything
    assert [name for name, _ in selected(everything, "bridge")] == ["bridge"]
    with pytest.raises(ConfigError, match="--only brigde: no such process; available: router, sim"):
        selected(everything, "brigde")
