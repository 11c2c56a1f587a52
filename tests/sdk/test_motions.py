"""Motions of a drive on the simulated stack, in simulated time: where they end."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

import t2
from tests.simulated_robot import SimulatedStack, simulated_robot

START_MS = 3000  # until the stack may drive


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Iterator[t2.Robot]:
    stack = SimulatedStack("empty")
    with simulated_robot(stack, monkeypatch) as it:
        stack.run(START_MS)
        yield it
    assert stack.oracle.violations == []


def test_a_distance_and_a_turn_of_numpy_numbers(robot: t2.Robot) -> None:
    start = robot.odometry.latest()
    with robot.drive("nav") as drive:
        drive.forward(np.float64(0.2))
        there = robot.odometry.latest()
        assert math.dist((start.x, start.y), (there.x, there.y)) == pytest.approx(0.2, abs=0.05)
        drive.turn(np.float64(-0.4), np.float64(0.5), np.float64(3.0))
        turned = math.remainder(robot.odometry.latest().heading - there.heading, math.tau)
        assert turned == pytest.approx(-0.4, abs=0.1)
    with robot.drive("nav"):  # the next drive of a program is no second publisher
        causes = {cause.name for cause in robot.safety.latest().causes}
        assert "two_publishers" not in causes


def test_arcs_and_paths_end_at_their_places(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        pose = drive.arc(0.5, math.pi / 2)
        assert (pose.x, pose.y) == pytest.approx((0.5, 0.5), abs=0.1)
        assert pose.heading == pytest.approx(math.pi / 2, abs=0.1)
        assert len(pose.pose_covariance) == 9
        pose = drive.follow([(0.5, 1.0), (np.float64(1.2), 1.0)])
        assert (pose.x, pose.y) == pytest.approx((1.2, 1.0), abs=0.1)
        pose = drive.goto(0.6, 0.8, heading=0.0)
        assert (pose.x, pose.y) == pytest.approx((0.6, 0.8), abs=0.1)
        assert pose.heading == pytest.approx(0.0, abs=0.1)
        assert drive.goto(pose.x, pose.y).seq > pose.seq
        with pytest.raises(ValueError, match="only finite"):
            drive.goto(0.0, 0.0, math.nan)
        with pytest.raises(ValueError, match="radius must be positive"):
            drive.arc(-1.0, 1.0)
