"""The vehicle's side: what it answers and says, and how long what it times took."""

import socket
import subprocess
from dataclasses import dataclass
from pathlib import Path

from bench.path import processes
from common.wire import commands, reports
from common.wire.frame import Frame, Side
from common.wire.framing import Framing
from verification.harness.ports import free_port

SOURCE = Path(__file__).with_name("vehicle.c")
FRAMING = Framing("crc-16", "payload")
FREE_MM = 6000  # beyond what a sonar hears: no echo
KINDS = (0, 1, 2)
SPEEDS_MMPS = (0, 100, 101)  # asked for; apart by what a frame can tell
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
    """Where the vehicle is on loopback, and whom it talks to."""

    board: int
    to: int
    witness: int
    asker: int = 0


def free_ports(*, asks: bool) -> Ports:
    """Return ports that nobody has."""
    board, to, witness, asker = (free_port(socket.SOCK_DGRAM) for _ in range(4))
    return Ports(board, to, witness, asker if asks else 0)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The program, compiled."""

    program: str

    def timed(self, ports: Ports, rounds: int, warm: int) -> list[int]:
        """Return how long so many rounds took, in ns; -1 for what was lost.

        With an asker from requests to motion frames, else from velocity frames to the witness.
        """
        command = self._command(ports, rounds, warm)
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        if done.returncode:
            raise RuntimeError(done.stderr.strip())
        return [int(line) for line in done.stdout.split()]

    def standing(self, ports: Ports) -> list[str]:
        """Return how a vehicle is run that only stands there, until killed."""
        return self._command(ports, 0, 0)

    def _command(self, it: Ports, rounds: int, warm: int) -> list[str]:
        frames = MOTIONS if it.asker else VELOCITIES
        numbers = (it.board, it.to, it.witness, it.asker, rounds, warm)
        said = (STANDS, *frames, *(frame for pair in ANSWERS for frame in pair))
        return [self.program, *map(str, numbers), *(FRAMING.pack(each).hex() for each in said)]


def compiled(folder: Path) -> Vehicle:
    """Compile it into a folder; raise ``FileNotFoundError`` where there is no C compiler."""
    return Vehicle(str(processes.compiled(SOURCE, folder)))
