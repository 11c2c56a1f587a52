"""The simulated board of the benchmark ``load``: periodic frames, answers, frames at a rate."""

import contextlib
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from bench.path import processes
from common.wire import commands, reports
from common.wire.frame import Frame, Side
from common.wire.framing import Framing

SOURCE = Path(__file__).with_name("board.c")
FRAMING = Framing("crc-16", "payload")
PATIENCE_S = 30.0
CLEAR = reports.UltrasonicReport((4000,) * 8)
ANSWERS: Mapping[Frame, Frame] = {
    commands.BumperQuery(): reports.BumperReport(False),
    commands.DistanceQuery(): reports.DistanceReport(0, 0),
    commands.UltrasonicQuery(): CLEAR,
    commands.DriverQuery(Side.LEFT): reports.DriverReport(Side.LEFT, 0),
    commands.DriverQuery(Side.RIGHT): reports.DriverReport(Side.RIGHT, 0),
    commands.UltrasonicBrakeSet(True): reports.UltrasonicBrakeReport(True),
    commands.BumperBrakeSet(True): reports.BumperBrakeReport(True),
}
STANDS = reports.VelocityReport(0, 0)
SHIPPED: Mapping[Frame, float] = {STANDS: 50.0}  # periodic frames in Hz


@dataclass(frozen=True, slots=True)
class Board:
    """A running board."""

    process: "subprocess.Popen[str]"

    def send(self, hz: float, count: int) -> float:
        """Send velocity reports at a rate; return the reached rate."""
        return count * 1e9 / int(self._execute(f"{hz} {count}"))

    def counted(self) -> tuple[int, int]:
        """Return the bytes received and sent so far, with the headers of IPv4 and UDP."""
        received, sent = map(int, self._execute("bytes").split())
        return received, sent

    def _execute(self, line: str) -> str:
        out, back = self.process.stdin, self.process.stdout
        assert out is not None
        assert back is not None
        out.write(f"{line}\n")
        out.flush()
        return back.readline()


def compiled(folder: Path) -> Path:
    """Compile the program into a folder; raise ``FileNotFoundError`` without a C compiler."""
    return processes.compiled(SOURCE, folder)


@contextlib.contextmanager
def board(program: Path, port: int, to: int, says: Mapping[Frame, float]) -> Iterator[Board]:
    """Run a board between two ports on loopback; ``says`` has the periodic frames in Hz."""
    periodic = [f"{_hex(frame)}@{hz}" for frame, hz in says.items()]
    answers = [f"{_hex(query)}={_hex(answer)}" for query, answer in ANSWERS.items()]
    command = [str(program), str(port), str(to), *periodic, *answers]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield Board(process)
        finally:
            process.kill()


def _hex(frame: Frame) -> str:
    return FRAMING.pack(frame).hex()
