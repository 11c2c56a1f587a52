"""Paths by a kinematic vehicle that obeys late, in simulated time."""

import math
import random
from collections import deque
from collections.abc import Sequence

import pytest

from t2.messages import Odometry
from t2.motion import Path

PERIOD_S, LATE, PATIENCE = 0.05, 4, 2400  # samples that a request is late; samples for a path

Points = Sequence[tuple[float, float]]


def pose(x: float, y: float, heading: float) -> Odometry:
    return Odometry(
        x=x, y=y, heading=heading, linear=0.0, angular=0.0, epoch=0, residual=None, slip=False,
        pose_covariance=(0.0,) * 9, twist_covariance=(0.0,) * 4,
    )  # fmt: skip


def end_of(points: Points) -> tuple[float, float]:
    """Drive a path from the origin; return where it ends."""
    x = y = heading = 0.0
    path = Path(pose(x, y, heading), points, 0.3, 0.5)
    requests = deque([(0.0, 0.0)] * LATE)
    for _ in range(PATIENCE):
        here = pose(x, y, heading)
        left = path.left(here)
        if left <= path.near:
            return x, y
        requests.append(path.velocity(here, left))
        linear, angular = requests.popleft()
        x += linear * PERIOD_S * math.cos(heading)
        y += linear * PERIOD_S * math.sin(heading)
        heading = math.remainder(heading + angular * PERIOD_S, math.tau)
    raise AssertionError(f"the path does not end: {points}")


RANDOM = random.Random(1)
PATHS = [
    [(1.0, 0.0), (0.0, 0.0)],  # back on the same line
    [(1.0, 0.0), (0.5, 0.1)],
    [(0.1, 0.0), (0.1, 0.1), (0.0, 0.1), (0.0, 0.0)],
    [(-1.0, 0.0)],
    [(0.5, 0.0), (0.5, 0.0), (1.0, 0.5)],
    *([(RANDOM.uniform(-1, 1), RANDOM.uniform(-1, 1)) for _ in range(4)] for _ in range(100)),
]


@pytest.mark.parametrize("points", PATHS)
def test_a_path_with_any_corners_ends_at_its_last_point(points: Points) -> None:
    assert math.dist(end_of(points), points[-1]) < 0.1


def test_a_turn_within_a_path_is_shown_until_it_ends() -> None:
    path = Path(pose(0.0, 0.0, 0.0), [(-1.0, 0.0)], 0.3, 0.5)
    assert path.left(pose(0.0, 0.0, 0.0)) == 1.0
    for heading in (0.0, 2.0, 3.0):
        assert path.velocity(pose(0.0, 0.0, heading), 1.0)[0] == 0.0
        assert path.turning == pytest.approx(math.pi - heading)
    assert path.velocity(pose(0.0, 0.0, 3.1), 1.0)[0] > 0.0
    assert path.turning == 0.0


def test_a_path_without_a_length_has_ended() -> None:
    assert Path(pose(0.0, 0.0, 0.0), [(0.0, 0.0)], 0.3, 0.5).left(pose(0.0, 0.0, 0.0)) == 0.0
