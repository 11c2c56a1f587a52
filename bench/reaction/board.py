"""The simulated board of the benchmark ``reaction``: its frames and reaction times."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

from bench.path import processes
from common.wire import commands, reports
from common.wire.framing import Framing

HERE = Path(__file__).parent
FRAMING = Framing("crc-16", "payload")
HIT, CLEAR = (FRAMING.pack(reports.BumperReport(on)).hex() for on in (True, False))
BREAK, STOP = (
    FRAMING.pack(commands.MotionCommand(kind)).hex()
    for kind in (commands.MotionKind.BREAK, commands.MotionKind.STOP)
)
# Safety accepts a reset only while the vehicle stands.
STANDS = FRAMING.pack(reports.VelocityReport(0, 0)).hex()
PATIENCE_S = 600.0


@dataclass(frozen=True, slots=True)
class Programs:
    """The compiled C programs."""

    folder: Path

    @property
    def echo(self) -> str:
        """The program that answers by comparing bytes."""
        return str(self.folder / "echo")

    def hits(self, board: int, to: int, rounds: int, warm: int) -> list[int]:
        """Report hits from one port to another; return the ns until each BRAKE.

        Raise ``RuntimeError`` when a hit is not answered.
        """
        words = [str(self.folder / "board"), *map(str, (board, to, rounds, warm))]
        done = subprocess.run(
            [*words, HIT, CLEAR, BREAK, STOP, STANDS],
            capture_output=True, text=True, timeout=PATIENCE_S, check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(done.stderr.strip())
        return [int(line) for line in done.stdout.split()]


def compiled(folder: Path) -> Programs:
    """Compile the programs into a folder; raise ``FileNotFoundError`` without a C compiler."""
    for name in ("board", "echo"):
        processes.compiled(HERE / f"{name}.c", folder)
    return Programs(folder)
