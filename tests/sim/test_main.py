import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import pytest

from common import realtime
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.wire import framing
from common.wire.commands import BumperQuery, MotionCommand, MotionKind
from common.wire.framing import Received
from common.wire.reports import FROM_BOARD, BumperReport, VelocityReport
from sim.__main__ import main
from sim.requests import Bumper, Place, PowerCycle
from sim.trace import read
from t2.errors import LinkError, MessageError
from tests.common.rights import needs_right
from verification.harness.ports import free_port
from verification.harness.stack import Control
from verification.harness.waiting import PATIENCE_S, wait_until


@dataclass(frozen=True)
class Bench:
    """Ports of a simulator, the PC's sockets, and the trace."""

    port: int
    control_port: int
    pc: tuple[socket.socket, socket.socket]
    trace: Path

    @property
    def arguments(self) -> list[str]:
        """Return the command line that fits."""
        listen = ",".join(str(sock.getsockname()[1]) for sock in self.pc)
        sets = [
            f"board.port={self.port}",
            f"board.listen_ports={listen}",
            f"sim.control_port={self.control_port}",
        ]
        return ["--trace", str(self.trace), *(word for text in sets for word in ("--set", text))]

    def send(self, frame: Any) -> None:
        """Send a frame to the board from the PC's first port."""
        self.pc[0].sendto(framing.pack(frame), ("127.0.0.1", self.port))

    def received(self, index: int = 0) -> list[Any]:
        """Return the frames that wait at one of the PC's ports."""
        frames: list[Any] = []
        with suppress(BlockingIOError):
            while True:
                for part in framing.read(self.pc[index].recv(4096), FROM_BOARD):
                    frames += [part.frame] if isinstance(part, Received) else []
        return frames

    def lines(self, event: str) -> list[dict[str, Any]]:
        """Return the trace's lines of one kind."""
        lines = msgspec.to_builtins(read(self.trace.read_bytes()))
        return [line for line in lines if line["event"] == event]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with ExitStack() as stack:
        pc = []
        for _ in range(2):
            sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            sock.bind(("127.0.0.1", 0))
            sock.setblocking(False)
            pc.append(sock)
        ports = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
        yield Bench(*ports, (pc[0], pc[1]), tmp_path / "trace.jsonl")


@contextmanager
def process(bench: Bench, *words: str) -> Iterator["subprocess.Popen[bytes]"]:
    """Run the simulator as a process of its own until the context ends."""
    command = [sys.executable, "-m", "sim", *bench.arguments, *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as running:
        try:
            wait_until(lambda: bench.received(), "the board's first frame")
            yield running
        finally:
            running.kill()


def test_a_process_streams_drives_and_is_disturbed(bench: Bench) -> None:
    with process(bench, "--world", "office", "--profile", "centimetre-sonar") as running:
        wait_until(lambda: VelocityReport(0, 0) in bench.received(1), "the second port's stream")
        bench.send(MotionCommand(MotionKind.RUN, 500))
        wait_until(lambda: VelocityReport(500, 0) in bench.received(), "500 mm/s")
        control = Control(bench.control_port, PATIENCE_S)
        control.do(Bumper(pressed=True))
        bench.send(BumperQuery())
        wait_until(lambda: BumperReport(True) in bench.received(), "a pressed bumper")
        assert control.truth().pressed
        with pytest.raises(MessageError, match="an obstacle is at x 4, y 0"):
            control.do(Place(x=4.0, y=0.0))
        control.do(PowerCycle(seconds=0.1))
        wait_until(lambda: len(bench.lines("power")) == 2, "power again")
        running.send_signal(signal.SIGINT)
        assert running.wait(PATIENCE_S) == 0
        assert running.stderr is not None
        assert b"Traceback" not in running.stderr.read()
    (command,) = bench.lines("command")
    assert (command["kind"], command["linear"]) == ("run", 0.5)
    assert bench.lines("truth")[-1]["x"] > 0.0
    done = [line["request"]["do"] for line in bench.lines("fault")]
    assert done == ["bumper", "place", "power_cycle"]
    assert [line["pressed"] for line in bench.lines("bumper_sent")] == [True]
    assert [line["on"] for line in bench.lines("power")] == [False, True]


@needs_right
@pytest.mark.parametrize(("asked", "priority"), [("true", realtime.BOARD), ("false", 0)])
def test_nobody_on_board_keeps_it_waiting(bench: Bench, asked: str, priority: int) -> None:
    with process(bench, "--set", f"host.realtime={asked}") as running:
        assert realtime.priority(running.pid) == priority


def test_a_taken_port_ends_it_with_a_clear_sentence(
    bench: Bench, capfd: pytest.CaptureFixture[str]
) -> None:
    setting = "sim.control_port"  # the second one: the first is closed again
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert main([*bench.arguments, "--set", f"{setting}={port}"]) == EXIT_LINK
    said: list[str] = []

    def refused() -> bool:
        said.append(capfd.readouterr().err)
        return f"{setting}: cannot listen on UDP port {port}" in "".join(said)

    wait_until(refused, "the sentence, which a thread of its own writes")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--world", "moon"], "sim.world = 'moon'"),
        (["--profile", "moon"], "--profile moon: no such file"),
        (["--set", "sim.sed=1"], "did you mean 'seed'"),
        (["--trace", "nowhere/trace.jsonl"], "--trace nowhere/trace.jsonl: cannot be written"),
    ],
)
def test_bad_settings_end_it_with_what_is_wrong(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == EXIT_CONFIG
    assert named in capsys.readouterr().err


def test_the_profiles_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list-profiles"]) == 0
    assert "short-sonar " in capsys.readouterr().out


def test_without_control_port_and_trace_there_is_neither(bench: Bench) -> None:
    words = bench.arguments[2:-2]  # without --trace and sim.control_port
    command = [sys.executable, "-m", "sim", *words]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as running:
        wait_until(lambda: bench.received(), "the board's first frame")
        with pytest.raises(LinkError):
            Control(bench.control_port, timeout_s=0.2).truth()
        running.terminate()
        assert running.wait(PATIENCE_S) == 0
    assert not bench.trace.exists()
