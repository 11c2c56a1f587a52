"""The watchdog test as a process against the simulated board, judged by the received frames."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from cli.demo.score import read
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.wire.commands import MotionKind
from common.wire.frame import Frame
from sim.requests import Freeze
from sim.sockets import Control
from sim.trace import Command
from tests.cli.commission.operator_process import PATIENCE_S, OperatorProcess, checkout
from tests.cli.processes import ran, sets
from verification.harness.fake_board import Board, board
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

PHRASE = "wheels off the ground"
TRIES = 5


@dataclass
class Vehicle:
    """The simulator as a process, and the frames that its board has received."""

    words: list[str]
    trace_file: Path
    control: Control

    def commands(self) -> Sequence[Command]:
        return read(self.trace_file).commands if self.trace_file.exists() else []

    def runs(self) -> int:
        return sum(command.kind == "run" for command in self.commands())

    def is_braked(self) -> bool:
        made = self.commands()
        return bool(made) and made[-1].kind == "brake" and self.control.truth().linear == 0


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    own, first, second, control = (free_port(socket.SOCK_DGRAM) for _ in range(4))
    ports = [f"board.port={own}", f"board.listen_ports={first},{second}"]
    trace = tmp_path / "trace.jsonl"
    words = ["--world", "empty", "--trace", str(trace), "--set", f"sim.control_port={control}"]
    command = [sys.executable, "-m", "sim", *words, *sets(*ports)]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        try:
            assert b"started" in process.stderr.readline()
            yield Vehicle(sets(*ports), trace, Control(control))
        finally:
            process.kill()


def begin(it: OperatorProcess) -> None:
    it.begin()
    it.wait("Press Enter to begin")
    it.type("")
    it.wait(f'Type "{PHRASE}"')
    it.type(PHRASE)


def passes(it: OperatorProcess) -> bool:
    """Begin, and try again if a scheduling stall has aborted the test."""
    begin(it)
    for _ in range(TRIES):
        if it.wait("passed:", "failed:") == "passed:":
            return True
        it.wait("Press Enter to try again")
        it.type("")
        it.wait(f'Type "{PHRASE}"')
        it.type(PHRASE)
    return False


def test_a_board_without_a_watchdog(vehicle: Vehicle, tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    with checkout(report, "watchdog", *vehicle.words) as it:
        assert passes(it), it.shown
        assert it.sign() == 0, it.shown
    text = report.read_text(encoding="utf-8")
    assert "passed | Drives on for 1 s without a command: no watchdog. |" in text
    assert vehicle.is_braked()
    runs = [command for command in vehicle.commands() if command.kind == "run"]
    assert {command.linear for command in runs} == {0.05}
    assert {command.angular for command in runs} == {0.0}
    truth = vehicle.control.truth()
    assert truth.ultrasonic_brake
    assert truth.bumper_brake


class Watched(Board):
    """A board that stops by itself half a second after the last command."""

    commanded_s = 0.0

    def _take(self, frame: Frame, source: tuple[str, int]) -> None:
        before = len(self.motions)
        super()._take(frame, source)
        if len(self.motions) > before:
            self.commanded_s = time.monotonic()
            self.speed_mmps = self.motions[-1].linear_mmps

    def say(self, frame: Frame, sock: socket.socket | None = None) -> None:
        if time.monotonic() - self.commanded_s > 0.5:
            self.speed_mmps = 0
        super().say(frame, sock)


def test_a_board_with_a_watchdog(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("verification.harness.fake_board.Board", Watched)
    report = tmp_path / "report.md"
    with board() as dog:
        words = sets(
            f"board.port={dog.address[1]}",
            f"board.listen_ports={dog.ports[0]},{dog.ports[1]}",
        )
        with checkout(report, "watchdog", *words) as it:
            assert passes(it), it.shown
            assert it.sign() == 0, it.shown
        dog.wait_for(MotionKind.BREAK)
    assert "passed | Stops by itself after 0." in report.read_text(encoding="utf-8")


def is_aborted(it: OperatorProcess, vehicle: Vehicle, number: signal.Signals) -> bool:
    """Send a signal during RUN; a scheduling stall may have ended the test before."""
    before = vehicle.runs()
    begin(it)
    wait_until(lambda: vehicle.runs() > before, "a RUN")
    it.signal(number)
    ends = ("Ended early: Ctrl-C", "Ended early: The board", "passed:")
    return it.wait(*ends) == "Ended early: Ctrl-C"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_brakes(vehicle: Vehicle, tmp_path: Path, number: signal.Signals) -> None:
    for attempt in range(TRIES):
        report = tmp_path / f"report{attempt}.md"
        with checkout(report, "watchdog", *vehicle.words) as it:
            if not is_aborted(it, vehicle, number):
                continue
            assert vehicle.is_braked()
            it.wait("any word to continue")
            it.type("on")
            assert it.sign() == 1
        assert vehicle.is_braked()
        assert "failed | Ended early: Ctrl-C |" in report.read_text(encoding="utf-8")
        return
    raise AssertionError("no test lasted until the signal")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_or_stopped_process_brakes(
    vehicle: Vehicle, tmp_path: Path, number: signal.Signals
) -> None:
    with checkout(tmp_path / "report.md", "watchdog", *vehicle.words) as it:
        begin(it)
        wait_until(vehicle.runs, "a RUN")
        it.signal(number)
        wait_until(vehicle.is_braked, "BRAKE at the board, and standstill", PATIENCE_S)


def test_a_board_that_falls_silent_brakes(vehicle: Vehicle, tmp_path: Path) -> None:
    with checkout(tmp_path / "report.md", "watchdog", *vehicle.words) as it:
        begin(it)
        wait_until(vehicle.runs, "a RUN")
        vehicle.control.do(Freeze(seconds=1.5))
        it.wait("Ended early: The board was silent")
        wait_until(vehicle.is_braked, "BRAKE at the board, and standstill")


def test_no_motion_without_confirmation(vehicle: Vehicle, tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    with checkout(report, "watchdog", *vehicle.words) as it:
        it.begin()
        it.wait("Press Enter to begin")
        it.type("")
        it.wait(f'Type "{PHRASE}"')
        it.type("yes")
        it.wait("failed: Not confirmed: no motion was commanded.")
        it.close_input()
        assert it.end() == 1
    assert vehicle.commands() == []
    assert "standard input has ended" in report.read_text(encoding="utf-8")


def test_no_test_without_a_board(tmp_path: Path) -> None:
    first, second = (free_port(socket.SOCK_DGRAM) for _ in range(2))
    with checkout(
        tmp_path / "report.md", "watchdog", *sets(f"board.listen_ports={first},{second}")
    ) as it:
        begin(it)
        it.wait("failed: The board does not report standstill")
        it.wait("any word to continue")
        it.type("on")
        assert it.sign() == 1


def test_the_brakes_must_be_confirmed(tmp_path: Path) -> None:
    with board() as mute:
        mute.echo = False
        words = sets(f"board.port={mute.address[1]}", f"board.listen_ports={mute.ports[0]}")
        with checkout(tmp_path / "report.md", "watchdog", *words) as it:
            begin(it)
            it.wait("did not send: UltrasonicBrakeReport, BumperBrakeReport.")
        assert all(motion.kind is MotionKind.BREAK for motion in mute.motions)


def test_a_running_bridge_is_refused(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        result = ran("checkout", "watchdog", *sets(f"board.listen_ports={port}"),
                     "--report", str(tmp_path / "report.md"))  # fmt: skip
    assert result.returncode == EXIT_LINK
    assert "is a bridge running already?" in result.stderr
    assert not (tmp_path / "report.md").exists()


def test_a_report_is_not_overwritten(tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    report.write_text("signed", encoding="utf-8")
    result = ran("checkout", "watchdog", "--report", str(report))
    assert result.returncode == EXIT_CONFIG
    assert "exists already" in result.stderr
    assert report.read_text(encoding="utf-8") == "signed"


def test_a_report_needs_a_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    result = ran("checkout", "--report", str(tmp_path / "file" / "report.md"))
    assert result.returncode == EXIT_CONFIG
    assert "cannot be written" in result.stderr


def test_the_watchdog_test_has_no_steps() -> None:
    result = ran("checkout", "watchdog", "--only", "link")
    assert result.returncode == EXIT_CONFIG
    assert "has no steps" in result.stderr
