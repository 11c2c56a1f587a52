"""Arcs against closed form, covariance against numeric derivatives, fitted segments."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.pose import Covariance, Pose
from services.odom.core.pose import (
    ArcSegment,
    PoseEstimate,
    ProcessNoise,
    fitted,
    halved,
    total,
)
from tests.odom.core.odom_fixture import apart

distances = st.floats(-3.0, 3.0)
turns = st.floats(-6.0, 6.0)
headings = st.floats(-math.pi, math.pi)
variances = st.floats(0.0, 0.5)
segments = st.builds(
    ArcSegment, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.001, 0.2), st.booleans()
)
ways = st.lists(segments, max_size=8)

CERTAIN = Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CLOSE = pytest.approx((0.0, 0.0), abs=1e-9)
QUARTER = math.pi / 2


@given(headings, distances, turns, st.floats(0.0, 1.0))
def test_an_arc_equals_its_parts_and_lies_on_its_circle(
    heading: float, distance: float, turn: float, part: float
) -> None:
    whole = Pose(4.0, -7.0, heading).moved(distance, turn)
    first = Pose(4.0, -7.0, heading).moved(distance * part, turn * part)
    assert apart(first.moved(distance * (1 - part), turn * (1 - part)), whole) == CLOSE
    assert abs(whole.heading) <= math.pi
    if abs(turn) > 0.01:
        radius = distance / turn
        x = 4.0 + radius * (math.sin(heading + turn) - math.sin(heading))
        y = -7.0 - radius * (math.cos(heading + turn) - math.cos(heading))
        assert (whole.x, whole.y) == pytest.approx((x, y), abs=1e-6)


def derivative(start: Pose, distance: float, turn: float) -> np.ndarray:
    """Return d(x, y, heading) after the arc by (x, y, heading, distance, turn), numerically."""
    step = 1e-6
    at = np.array([start.x, start.y, start.heading, distance, turn])
    columns = []
    for unit in np.eye(5) * step:
        ends = [Pose(*moved[:3]).moved(*moved[3:]) for moved in (at + unit, at - unit)]
        turned = math.remainder(ends[0].heading - ends[1].heading, math.tau)
        columns.append((ends[0].x - ends[1].x, ends[0].y - ends[1].y, turned))
    return np.array(columns).T / (2 * step)


@given(headings, distances, turns, st.builds(ProcessNoise, variances, variances, variances))
def test_covariance_follows_the_derivatives(
    heading: float, distance: float, turn: float, noise: ProcessNoise
) -> None:
    start = Pose(2.0, 3.0, heading)
    before = CERTAIN.plus(0.3, 1.0, 0.2, 0.1).plus(0.2, -0.3, 1.0, -0.5).plus(0.1, 0.0, 0.0, 1.0)
    after = PoseEstimate(start, before).moved(distance, turn, noise)
    whole = np.zeros((5, 5))
    whole[:3, :3] = np.reshape(before.rows(), (3, 3))
    whole[3, 3], whole[4, 4] = noise.distance, noise.turn
    by = derivative(start, distance, turn)
    expected = by @ whole @ by.T + np.diag([noise.place, noise.place, 0.0])
    assert after.covariance.rows() == pytest.approx(expected.ravel(), abs=1e-6)


# --- segments -------------------------------------------------------------------------------


SEEN, UNSEEN = (ArcSegment(1.0, 0.0, 1.0, seen) for seen in (True, False))


@pytest.mark.parametrize(
    ("way", "distance", "turn", "expected"),
    [
        ([], 1.0, 0.5, [ArcSegment(1.0, 0.5, 0.0, seen=True)]),
        ([SEEN, UNSEEN], 4.0, 0.5, [SEEN, ArcSegment(3.0, 0.5, 1.0, seen=False)]),
        (
            [SEEN, ArcSegment(1.0, 0.0, 3.0, seen=True)],
            6.0,
            -4.0,
            [ArcSegment(2.0, -1.0, 1.0, seen=True), ArcSegment(4.0, -3.0, 3.0, seen=True)],
        ),
    ],
)
def test_the_difference_is_distributed_over_the_unseen_time_or_over_all(
    way: list[ArcSegment], distance: float, turn: float, expected: list[ArcSegment]
) -> None:
    assert fitted(way, distance, turn) == expected


@given(ways)
def test_halved_segments_are_the_same_trajectory(way: list[ArcSegment]) -> None:
    half, whole = total(halved(way)), total(way)
    assert len(halved(way)) == (len(way) + 1) // 2
    assert (half.distance, half.turn) == pytest.approx((whole.distance, whole.turn), abs=1e-9)
    assert half.seen == whole.seen
