"""``t2 up`` as a process: start, restart of killed services, and clean exit."""

import os
import signal
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.run import up
from cli.run.up import everything, selected
from cli.settings import Everything
from common.cli_args import EXIT_CONFIG, EXIT_LINK, sources
from common.config import load
from common.errors import ConfigError
from t2.errors import T2Error
from tests.cli.processes import PATIENCE_S, children, ran, running, sets, t2, wait_gone
from tests.cli.stack import STACK, ports, starts
from verification.harness.waiting import wait_until


def test_a_second_stack_starts_nothing_and_killed_services_start_again(tmp_path: Path) -> None:
    log = tmp_path / "log"
    words = sets(*ports(), "log.format=json", f"recorder.folder={tmp_path}")
    with running(t2("up", *words), log) as up:
        wait_until(lambda: all(starts(log, name) for name in STACK), "all of them", PATIENCE_S)
        first = children(up.pid)
        assert set(first) == STACK

        # A second stack starts nothing, also at the router of the first one.
        second_up = ran("up", *words, "--no-router")
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


def options(*words: str) -> Namespace:
    parser = ArgumentParser()
    up.add_arguments(parser)
    return parser.parse_args(words)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ((), "router sim bridge safety odom localization patrol recorder"),
        (("--no-sim",), "router bridge safety odom localization patrol recorder"),
        (("--no-router", "--ros2"), "sim bridge safety odom localization patrol recorder ros2"),
        (("--only", "bridge"), "bridge"),
    ],
)
def test_processes_in_order_of_dependency(words: tuple[str, ...], names: str) -> None:
    given = options(*words, "--world", "x", "--config", "a.toml", "--set", "robot.id=2")
    found = selected(everything(given), given.only)
    assert list(found) == names.split()
    passed = ["--config", "a.toml", *sets("sim.world=x", "robot.id=2")]
    for command in found.values():
        assert command[-len(passed) :] == passed


def test_the_camera_of_the_settings_or_a_simulated_one() -> None:
    def found(*words: str) -> dict[str, list[str]]:
        given = options(*words)
        config = load(Everything, sources(given)).config
        return {k: list(v) for k, v in up.camera(given, config, everything(given)).items()}

    simulated = found()
    assert list(simulated) == ["sim", "sim.camera", "camera"]
    port = next(one for one in simulated["sim"] if one.startswith("sim.camera_port="))
    assert f"camera.source=tcp://127.0.0.1:{port.partition('=')[2]}" in simulated["camera"]
    own = sets("camera.source=/dev/video0")
    assert found(*own) == found(*own, "--no-sim") == {"camera": [*simulated["camera"][:4], *own]}
    assert found("--no-sim") == {}


def test_a_process_that_does_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="--only brigde: no such process; available: router, sim"):
        selected(everything(options()), "brigde")
    monkeypatch.setitem(sys.modules, "xxhash", None)
    with pytest.raises(T2Error, match="--ros2 needs xxhash: install the extra `ros2`"):
        everything(options("--ros2"))
