import pytest

from sim.geometry import Pose, Rectangle, Segment

BODY = Rectangle(1.0, 0.5)
ORIGIN = Pose(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("segment", "gap"),
    [
        (Segment(3.0, -9.0, 3.0, 9.0), 2.0),  # a wall ahead
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
