"""What tests see of a bridge under its guard."""

import subprocess
from pathlib import Path

from common.wire.commands import MotionKind
from verification.harness.fake_board import Board
from verification.harness.waiting import wait_until

PROC = Path("/proc")


def bridge_pid(guard: "subprocess.Popen[bytes]") -> int:
    """Return the process that the guard watches, once there is one."""
    children = PROC / f"{guard.pid}/task/{guard.pid}/children"
    return int(wait_until(lambda: children.read_text().split(), "a bridge under the guard")[0])


def breaks_since(made: Board, count: int) -> int:
    """Return how many BREAKs the board got after that many commands."""
    return [motion.kind for motion in made.motions[count:]].count(MotionKind.BREAK)
