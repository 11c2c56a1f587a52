"""``t2 checkout watchdog`` on a simulator process, over UDP on loopback."""

import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from cli.__main__ import main
from cli.commission import command
from cli.commission.board_link import BRAKE, BRAKES, Times, board_link
from cli.demo.score import read
from cli.settings import Everything
from common.settings import Board as BoardSettings
from sim.__main__ import Process
from sim.config import Config, load_plan
from sim.model import Firmware as FirmwareModel
from sim.model import Model
from sim.requests import Bumper, Driver, Firmware, Mute
from sim.simulation import Simulation
from t2.messages import Command
from tests.cli.processes import sets, t2
from verification.harness.bus import set_options
from verification.harness.ports import free_port, udp_ports
from verification.harness.stack import Control, running_stack
from verification.harness.waiting import wait_until

SHORT = Times(turning=1.0, fed=(1.5, 1.5), silent=(0.3, 1.5))
ANSWERS = ["Ada", "1.0", "wheels off the ground", "Ada"]


@dataclass
class Board:
    """A simulated board without a stack."""

    sets: list[str]
    control: Control
    trace: Path

    def commands(self) -> list[tuple[str, float]]:
        """Return kind and linear velocity of each motion command so far."""
        return [(each.kind, each.linear) for each in read(self.trace).commands]

    def ends_braked(self) -> bool:
        return [kind for kind, _ in self.commands()[-BRAKES:]] == ["brake"] * BRAKES


@contextmanager
def simulated_board(folder: Path) -> Iterator[Board]:
    port, control, *listen = udp_ports(4)
    trace = folder / "trace.jsonl"
    all_of = [f"board.port={port}", f"board.listen_ports={listen}"]
    router = f"bus.connect=['tcp/127.0.0.1:{free_port()}']"  # none listens there
    words = [*set_options(*all_of, f"sim.control_port={control}"), "--world", "empty"]
    with subprocess.Popen([sys.executable, "-m", "sim", *words, "--trace", str(trace)]) as process:
        try:
            board = Board([*all_of, router], Control(control, timeout_s=60.0), trace)
            wait_until(lambda: trace.exists() and trace.stat().st_size, "the simulator", 60.0)
            yield board
        finally:
            process.kill()


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    with simulated_board(tmp_path) as board:
        yield board


@pytest.fixture
def measure(board: Board, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> "Measure":
    return Measure(board, tmp_path / "report.md", monkeypatch)


class Measure:
    """Runs the command with answers, and shorter tries."""

    def __init__(self, board: Board, report: Path, patch: pytest.MonkeyPatch) -> None:
        self.board, self.report = board, report
        self._patch = patch
        patch.setattr(command, "Times", lambda: SHORT)

    def __call__(self, answers: Sequence[str] = ANSWERS) -> int:
        typed = iter(answers)
        for module in ("cli.commission.command", "cli.commission.steps"):
            self._patch.setattr(f"{module}.prompt", lambda _: next(typed))
        words = ["checkout", "watchdog", "--report", str(self.report)]
        return main([*words, *set_options(*self.board.sets)])


@pytest.mark.timed
def test_a_board_without_a_watchdog(measure: Measure) -> None:
    assert measure() == 0
    text = measure.report.read_text().partition("<!--")[0]  # without its record
    assert (
        "drives on for at least 1.5 s without a motion command, and for 1.5 s without any" in text
    )
    assert "it has no watchdog" in text
    travelled = [float(m) for m in re.findall(r"drives on for 1.5 s, ([0-9.]+) m", text)]
    assert len(travelled) == 3
    assert all(0.1 < each < 0.3 for each in travelled)
    assert "Ada, " in text
    assert measure.board.ends_braked()
    assert all(linear <= 0.1 for _, linear in measure.board.commands())
    assert {kind for kind, _ in measure.board.commands()} == {"run", "stop", "brake"}


@pytest.mark.timed
def test_a_board_with_a_watchdog(measure: Measure) -> None:
    measure.board.control.do(Firmware(watchdog=0.8))
    assert measure() == 0
    text = measure.report.read_text()
    found = re.search(
        r"by itself ([0-9.]+) s \(.* in 2 tries\) after .* in silence ([0-9.]+)", text
    )
    assert found, text
    fed_s, silent_s = map(float, found.groups())
    assert 0.75 < fed_s < 1.3
    # On a busy host it is seen as late as the silence of 1.5 s ends: the way is what shows it.
    assert 0.75 < silent_s < 2.5
    way = re.search(r"silence of 1.5 s \| slows at [0-9.]+ s, ([0-9.]+) m", text)
    assert way, text
    assert 0.06 < float(way[1]) < 0.13
    assert "silence of 0.3 s | drives on for 0.3 s" in text
    assert measure.board.ends_braked()


def test_wheels_that_do_not_turn(measure: Measure) -> None:
    measure.board.control.do(Firmware(ignores=(Command.RUN,)))
    assert measure() == 1
    assert (
        "Ended early: the wheels do not turn: 0.000 m/s after 1 s of RUN"
        in measure.report.read_text()
    )
    assert measure.board.ends_braked()


def test_what_ends_it_brakes(measure: Measure, capsys: pytest.CaptureFixture[str]) -> None:
    control = measure.board.control
    for begin, end, error in (
        (Bumper(pressed=True), Bumper(pressed=False), "the bumper was pressed"),
        (Driver(side="left", bits=4), Driver(side="left", bits=0), "left motor driver reports"),
        (Mute(reports=("velocity",)), Mute(), "no velocity from the board at 127.0.0.1"),
        (Mute(reports=("mileage",)), Mute(), "does not answer queries of its counters"),
    ):
        control.do(begin)
        assert measure() == 1
        assert error in capsys.readouterr().out
        assert measure.board.ends_braked()
        control.do(end)
        measure.report.unlink()


def test_nothing_moves_without_the_phrase(measure: Measure) -> None:
    assert measure(["Ada", "1.0", "no", "Ada"]) == 1
    assert "not confirmed" in measure.report.read_text()
    assert measure.board.commands() == []


@pytest.mark.parametrize(
    "numbers",
    [
        [signal.SIGINT],
        [signal.SIGQUIT],
        [signal.SIGTERM, signal.SIGHUP, signal.SIGINT],
        [signal.SIGHUP, signal.SIGTERM, signal.SIGTERM, signal.SIGQUIT],
    ],
)
def test_each_signal_brakes_while_the_board_holds_run(
    board: Board, tmp_path: Path, numbers: Sequence[signal.Signals]
) -> None:
    report = tmp_path / "report.md"
    words = t2("checkout", "watchdog", "--report", str(report), *sets(*board.sets))
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin
        process.stdin.write("\n".join(ANSWERS).encode() + b"\n")
        process.stdin.flush()
        wait_until(lambda: ("run", 0.1) in board.commands(), "a RUN", 60.0)
        process.send_signal(signal.SIGTSTP)  # Ctrl-Z does not suspend it
        wait_until(lambda: board.control.truth().linear > 0.09, "the speed", 60.0)
        for number in numbers:
            process.send_signal(number)
        process.communicate(timeout=60.0)
    assert process.returncode == 1
    assert board.ends_braked()
    assert board.control.truth().linear == 0.0
    assert "Ended early: interrupted by the operator" in report.read_text()


def test_no_signal_interrupts_the_brake(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(5.0)
        settings = BoardSettings(port=peer.getsockname()[1], listen_ports=tuple(udp_ports(2)))
        sleep = SimpleNamespace(sleep=lambda _: signal.raise_signal(signal.SIGINT))
        monkeypatch.setattr("cli.commission.board_link.time", sleep)
        with pytest.raises(KeyboardInterrupt), board_link(Everything(board=settings)):
            pass
        assert [peer.recv(100) for _ in range(2 * BRAKES)] == [BRAKE] * 2 * BRAKES
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


class FedBoard(Simulation):
    """A board whose watchdog is fed by each frame."""

    def receive(self, payload: bytes, port: int, now_ns: int) -> None:
        super().receive(payload, port, now_ns)
        self._command = replace(self._command, mono_ns=now_ns)


@pytest.mark.timed
def test_a_watchdog_that_queries_feed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.__main__.Simulation", FedBoard)
    port, *listen = udp_ports(3)
    settings = BoardSettings(port=port, listen_ports=tuple(listen))
    model = Model(firmware=FirmwareModel(watchdog=0.8))
    plan, trace = load_plan("empty", model.vehicle), tmp_path / "trace.jsonl"
    sets_ = [f"board.port={port}", f"board.listen_ports={listen}",
             f"bus.connect=['tcp/127.0.0.1:{free_port()}']"]  # fmt: skip
    with trace.open("wb", buffering=0) as file:
        process = Process(Config(board=settings), model, plan, file)
        thread = Thread(target=process.run)
        thread.start()
        try:
            board = Board(sets_, Control(0), trace)
            measure = Measure(board, tmp_path / "report.md", monkeypatch)
            assert measure() == 0
        finally:
            process.loop.stop()
            thread.join()
            process.close()
    text = measure.report.read_text()
    assert "they feed its watchdog. In silence it stops by itself" in text
    assert board.ends_braked()


def test_a_bridge_that_runs_is_not_disturbed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with running_stack(tmp_path) as stack:
        monkeypatch.setattr(command, "guide", lambda *_: pytest.fail("it has begun"))
        listen = stack.config.board.listen_ports
        for sets_, error in (
            ([f"bus.connect=['{stack.endpoint}']"], "a bridge runs for robot 001: stop it with"),
            ([f"board.listen_ports={list(listen)}", f"bus.connect=['tcp/127.0.0.1:{free_port()}']"],
             "another program has it"),
            (["board.relay_port=4010"], "board.relay_port is set: the relay brakes by itself"),
        ):  # fmt: skip
            assert main(["checkout", "watchdog", *set_options(*sets_)]) == 1
            assert error in capsys.readouterr().err
