"""Stops of the real stack, recorded by its recorder: safety's warning, doctor, and the fit."""

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.loop import Loop
from tests.cli.processes import ran, sets
from tests.drive_source import ConstantSource
from tests.recorder.make import recorder
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import PATIENCE_S, wait_until

COAST = 0.45  # m/s^2; safety reckons with 0.6, and STOP does not become BRAKE yet
SPEEDS = (0.5, 0.7)
STEADY_S = 0.5

pytestmark = pytest.mark.timed


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[RunningStack]:
    made = (f"sim.drive.coast={COAST}", "safety.max_linear=0.8", "safety.react=0.1")
    with running_stack(tmp_path, sets=made) as it:
        yield it


def stop_from(stack: RunningStack, source: ConstantSource, speed: float) -> None:
    """Drive at the speed, then end the requests without a zero: safety commands STOP."""
    source.linear = 0.0
    count = len(stack.trace().commands)
    wait_until(lambda: "run" in {c.kind for c in stack.trace().commands[count:]}, "a neutral")
    source.linear = speed
    wait_until(lambda: abs(stack.speed()) > 0.98 * abs(speed), "the full speed")
    time.sleep(STEADY_S)
    source.linear = None
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    time.sleep(STEADY_S)


def test_stops_that_are_longer_than_reckoned(stack: RunningStack, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    with recorder(stack, folder) as process, running(Loop()) as loop:
        source = ConstantSource(loop)
        with bus_on(stack.endpoint, loop, source.declare):
            for speed in SPEEDS:
                for direction in (1, -1):
                    stop_from(stack, source, direction * speed)
        process.terminate()
        process.wait(PATIENCE_S)
    assert "safety reckons with" in stack.log.read_text(encoding="utf-8")
    doctor = ran("doctor", "--json", "--set", f"bus.connect={stack.endpoint}")
    assert "longer than it reckons with" in doctor.stdout, doctor.stdout
    recordings = sorted(map(str, folder.glob("*.mcap")))
    words = (
        "checkout",
        "stop",
        *recordings,
        "--json",
        *sets("safety.max_linear=0.8", "safety.react=0.1"),
    )
    done = ran(*words)
    assert done.returncode == 1, done.stderr
    result = json.loads(done.stdout)
    assert result["present"]["verdict"] == "not safe"
    assert result["missing"] == [], done.stdout
    assert len(result["stops"]) == 2 * len(SPEEDS)
    for fit in result["fits"]:
        assert fit["deceleration"]["low"] <= COAST <= fit["deceleration"]["high"], fit
    assert result["proposal"]["deceleration"] <= COAST
    print(json.dumps(result["fits"], indent=1), json.dumps(result["proposal"]))  # noqa: T201
