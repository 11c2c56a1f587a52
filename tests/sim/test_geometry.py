import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.geometry import Pose, Rectangle, Segment, ray

BODY = Rectangle(1.0, 0.5)
ORIGIN = Pose(0.0, 0.0, 0.0)

coordinates = st.floats(-10.0, 10.0)
segments = st.builds(Segment, coordinates, coordinates, coordinates, coordinates)
poses = st.builds(Pose, coordinates, coordinates, st.floats(-7.0, 7.0))


@pytest.mark.parametrize(
    ("segment", "gap"),
    [
        (Segment(3.0, -9.0, 3.0, 9.0), 2.0),  # a wall ahead
        (Segment(-9.0, 0.75, 9.0, 0.75), 0.25),  # one on the left
        (Segment(4.0, 4.5, 4.0, 9.0), 5.0),  # its end off the corner: 3, 4, 5
        (Segment(1.5, 0.0, 2.5, 0.0), 0.5),  # its end ahead
        (Segment(-3.0, -0.5, -2.0, 0.5), 1.0),  # slanting, behind
        (Segment(1.0, -9.0, 1.0, 9.0), 0.0),  # touching
        (Segment(-9.0, 0.0, 9.0, 0.0), 0.0),  # right through
        (Segment(0.1, 0.1, 0.2, 0.2), 0.0),  # inside
        (Segment(3.0, 0.0, 3.0, 0.0), 2.0),  # a point
    ],
)
def test_gap_beside_a_rectangle(segment: Segment, gap: float) -> None:
    assert BODY.gap(ORIGIN, segment) == pytest.approx(gap)
    assert BODY.touches(ORIGIN, segment) is (gap == 0)


@given(segments, poses)
def test_gap_is_zero_when_they_touch_and_no_more_than_to_any_point(
    segment: Segment, pose: Pose
) -> None:
    gap = BODY.gap(pose, segment)
    assert (gap == 0) is BODY.touches(pose, segment)
    middle = (segment.ax + segment.bx) / 2, (segment.ay + segment.by) / 2
    assert gap <= min(math.dist(middle, pose.outward(x, y)) for x, y in BODY.corners()) + 1e-9


@pytest.mark.parametrize(
    ("angle", "distance"),
    [
        (0.0, 2.0),
        (math.pi / 4, 2.0 * math.sqrt(2)),
        (math.radians(60), math.inf),  # over its end: 2 * tan(60) = 3.46
        (math.pi / 2, math.inf),  # along it
        (math.pi, math.inf),  # away from it
    ],
)
def test_rays(angle: float, distance: float) -> None:
    assert ray(0.0, 0.0, angle, Segment(2.0, -3.0, 2.0, 3.0)) == pytest.approx(distance)
