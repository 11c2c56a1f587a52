"""The trajectory: thinned by distance, bounded."""

import math
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from services.odom.pose import Pose
from services.odom.trajectory import Path


def test_the_first_pose_is_kept_and_the_near_ones_are_not() -> None:
    path = Path(spacing=0.1, points=10)
    for x in (0.0, 0.05, 0.099, 0.1, 0.15, 0.25):
        path.add(Pose(x, 0.0, 0.5))
    assert path.points() == [(0.0, 0.0, 0.5), (0.1, 0.0, 0.5), (0.25, 0.0, 0.5)]


def test_the_oldest_go_first() -> None:
    path = Path(spacing=0.1, points=3)
    for x in range(5):
        path.add(Pose(float(x), 0.0, 0.0))
    assert [x for x, _, _ in path.points()] == [2.0, 3.0, 4.0]


def test_it_begins_anew() -> None:
    path = Path(spacing=0.1, points=3)
    path.add(Pose(1.0, 0.0, 0.0))
    path.clear()
    assert path.points() == []


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5))))
def test_points_are_never_nearer_than_the_spacing(places: list[tuple[float, float]]) -> None:
    path = Path(spacing=0.5, points=20)
    for x, y in places:
        path.add(Pose(x, y, 0.0))
    points = path.points()
    assert len(points) <= 20
    assert all(math.dist(a[:2], b[:2]) >= 0.5 for a, b in pairwise(points))
