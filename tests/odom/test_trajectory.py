"""The trajectory: downsampled by distance, bounded."""

import math
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from services.odom.pose import Pose, Trajectory


def test_the_first_pose_is_kept_and_the_near_ones_are_not() -> None:
    trajectory = Trajectory(spacing=0.1, points=10)
    for x in (0.0, 0.05, 0.099, 0.1, 0.15, 0.25):
        trajectory.add(Pose(x, 0.0, 0.5))
    assert trajectory.points() == [(0.0, 0.0, 0.5), (0.1, 0.0, 0.5), (0.25, 0.0, 0.5)]


def test_the_oldest_go_first() -> None:
    trajectory = Trajectory(spacing=0.1, points=3)
    for x in range(5):
        trajectory.add(Pose(float(x), 0.0, 0.0))
    assert [x for x, _, _ in trajectory.points()] == [2.0, 3.0, 4.0]


def test_it_begins_anew() -> None:
    trajectory = Trajectory(spacing=0.1, points=3)
    trajectory.add(Pose(1.0, 0.0, 0.0))
    trajectory.clear()
    assert trajectory.points() == []


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5))))
def test_points_are_never_nearer_than_the_spacing(places: list[tuple[float, float]]) -> None:
    trajectory = Trajectory(spacing=0.5, points=20)
    for x, y in places:
        trajectory.add(Pose(x, y, 0.0))
    points = trajectory.points()
    assert len(points) <= 20
    assert all(math.dist(a[:2], b[:2]) >= 0.5 for a, b in pairwise(points))
