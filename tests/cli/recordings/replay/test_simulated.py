"""``t2 replay --simulator`` on the real stack: the vehicle repeats its drive."""

import subprocess
import sys
from pathlib import Path

from verification.harness.stack import running_stack
from verification.harness.waiting import wait_until

LAP = Path(__file__).parents[3] / "recorder" / "lap.mcap"
MOVING_MPS = 0.1


def test_a_simulated_vehicle_repeats_the_drive(tmp_path: Path) -> None:
    with running_stack(tmp_path, "office") as stack:
        wait_until(lambda: '"service": "safety"' in stack.log.read_text(), "safety")
        words = ["replay", str(LAP), "--simulator", "--set", f"bus.connect={stack.endpoint}"]
        with subprocess.Popen([sys.executable, "-m", "cli", *words]) as process:
            wait_until(lambda: stack.speed() > MOVING_MPS, "it drives")
            assert process.wait(60) == 0
        wait_until(lambda: abs(stack.speed()) < MOVING_MPS / 10, "it stands again")
