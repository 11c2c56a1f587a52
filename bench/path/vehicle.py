"""The simulated vehicle at the ends of a path: its frames, and its measured durations."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

from bench.path import processes
from common.wire import commands, reports
from common.wire.frame import Frame, Side
from common.wire.framing import Framing
from verification.harness.ports import udp_ports

SOURCE = Path(__file__).with_name("vehicle.c")
FRAMING = Framing("crc-16", "payload")
FREE_MM = 6000  # beyond the range of a sonar: no echo
KINDS = (0, 1, 2)
SPEEDS_MMPS = (0, 100, 101)  # requested; distinguishable in a frame
PATIENCE_S = 600.0

ANSWERS: tuple[tuple[Frame, Frame], ...] = (
    (commands.DistanceQuery(), reports.DistanceReport(0, 0)),
    (
        commands.UltrasonicQuery(),
        reports.UltrasonicReport((FREE_MM,) * 8),
    ),
    (commands.BumperQuery(), reports.BumperReport(False)),
    (commands.UltrasonicBrakeSet(True), reports.UltrasonicBrakeReport(True)),
    (commands.BumperBrakeSet(True), reports.BumperBrakeReport(True)),
    *((commands.DriverQuery(side), reports.DriverReport(side, 0)) for side in Side),
)
STANDS = reports.VelocityReport(0, 0)
MOTIONS = tuple(commands.MotionCommand(commands.MotionKind.RUN, mmps) for mmps in SPEEDS_MMPS)
VELOCITIES = tuple(reports.VelocityReport(kind, 0) for kind in KINDS)  # mm/s: it stands


@dataclass(frozen=True, slots=True)
class Ports:
    """Ports of the vehicle and of its peers on loopback."""

    board: int
    to: int
    witness: int
    source: int = 0  # 0: no source, the vehicle sends velocities


def free_ports(*, requests: bool) -> Ports:
    """Return free ports."""
    board, to, witness, source = udp_ports(4)
    return Ports(board, to, witness, source if requests else 0)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The compiled program."""

    program: str

    def timed(self, ports: Ports, rounds: int, warm: int) -> list[int]:
        """Return the durations of rounds, in ns; -1 for a lost round.

        With a source from requests to motion frames, else from velocity frames to the witness.
        """
        command = self._command(ports, rounds, warm)
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        if done.returncode:
            raise RuntimeError(done.stderr.strip())
        return [int(line) for line in done.stdout.split()]

    def standing(self, ports: Ports) -> list[str]:
        """Return the command of a vehicle that only stands."""
        return self._command(ports, 0, 0)

    def _command(self, it: Ports, rounds: int, warm: int) -> list[str]:
        frames = MOTIONS if it.source else VELOCITIES
        numbers = (it.board, it.to, it.witness, it.source, rounds, warm)
        frames_given = (STANDS, *frames, *(frame for pair in ANSWERS for frame in pair))
        return [
            self.program,
            *map(str, numbers),
            *(FRAMING.pack(each).hex() for each in frames_given),
        ]


def compiled(folder: Path) -> Vehicle:
    """Compile the program into a folder; raise ``FileNotFoundError`` without a C compiler."""
    return Vehicle(str(processes.compiled(SOURCE, folder)))
