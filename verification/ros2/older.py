"""Checks with other versions of Zenoh: ``plain_peer.py`` in environments of their own."""

import json
import subprocess
from pathlib import Path
from typing import Any

from verification.ros2 import build, plain_peer
from verification.ros2.fixture import Robot

VERSIONS = "1.6.2", "1.7.2", "1.9.0"
PATIENCE_S = 120.0
SCRIPT = Path(plain_peer.__file__)


def version(robot: Robot, zenoh: str) -> str:
    """Run the plain peer with this version; compare what it saw with the simulator."""
    before = robot.truth()
    found = _run(build.environment(zenoh), robot.stack.endpoint)
    assert found["zenoh"] == zenoh, found["zenoh"]
    assert '<robot name="t2">' in found["description"], found["description"][:80]
    start, driven, latched = (x for x, _ in found["poses"])
    assert driven - start > 0.1, found["poses"]
    assert abs(latched - driven) < 0.02, f"moved while latched: {found['poses']}"
    moved = robot.distance() - before.distance
    assert abs(moved - (driven - start)) < 0.1, f"odometry {found['poses']}, vehicle {moved:.2f} m"
    for name in ("stop", "reset"):
        assert found[name][0], found[name]
    robot.wait_standstill()
    return f"description, odometry, {moved:.2f} m driven, stop, no motion while latched, reset"


def _run(python: Path, endpoint: str) -> dict[str, Any]:
    done = subprocess.run(
        [str(python), "-P", str(SCRIPT), endpoint],
        capture_output=True, text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-800:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found
