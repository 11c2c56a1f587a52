"""Arcs against closed form, covariance against numeric derivatives."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.odom.pose import SMALL_TURN, Covariance, Pose, PoseEstimate, ProcessNoise, chord_ratio

distances = st.floats(-3.0, 3.0)
turns = st.floats(-6.0, 6.0)
headings = st.floats(-math.pi, math.pi)
variances = st.floats(0.0, 0.5)

ORIGIN = Pose(0.0, 0.0, 0.0)
CERTAIN = Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
Matrix = list[list[float]]


def near(x: float, y: float, heading: float) -> "Near":
    """Return what equals such a pose."""
    return Near(Pose(x, y, heading))


class Near:
    """Equals a pose up to rounding, headings as directions."""

    def __init__(self, pose: Pose, tolerance: float = 1e-9) -> None:
        self.pose = pose
        self.tolerance = tolerance

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Pose):
            return NotImplemented
        turned = math.remainder(other.heading - self.pose.heading, math.tau)
        apart = math.hypot(other.x - self.pose.x, other.y - self.pose.y)
        return apart < self.tolerance and abs(turned) < self.tolerance

    def __hash__(self) -> int:
        return hash(self.pose)

    def __repr__(self) -> str:
        return f"near {self.pose}"


def test_straight_on() -> None:
    assert Pose(1.0, 2.0, math.pi / 2).moved(3.0, 0.0) == near(1.0, 5.0, math.pi / 2)


def test_a_quarter_circle_to_the_left() -> None:
    assert ORIGIN.moved(math.pi / 2, math.pi / 2) == near(1.0, 1.0, math.pi / 2)


def test_backward_along_a_quarter_circle() -> None:
    assert ORIGIN.moved(-math.pi / 2, math.pi / 2) == near(-1.0, -1.0, math.pi / 2)


def test_turning_on_the_spot_stays_there() -> None:
    assert Pose(1.0, 1.0, 0.0).moved(0.0, 2.0) == near(1.0, 1.0, 2.0)


def test_a_full_circle_comes_home() -> None:
    assert ORIGIN.moved(2 * math.pi, 2 * math.pi) == near(0.0, 0.0, 0.0)


@given(headings, distances, turns, st.floats(0.0, 1.0))
def test_an_arc_is_its_parts(heading: float, distance: float, turn: float, part: float) -> None:
    start = Pose(4.0, -7.0, heading)
    whole = start.moved(distance, turn)
    parts = start.moved(distance * part, turn * part).moved(
        distance * (1 - part), turn * (1 - part)
    )
    assert parts == Near(whole)


@given(headings, distances, turns.filter(lambda turn: abs(turn) > 0.01))
def test_an_arc_lies_on_its_circle(heading: float, distance: float, turn: float) -> None:
    radius = distance / turn
    after = Pose(0.0, 0.0, heading).moved(distance, turn)
    x = radius * (math.sin(heading + turn) - math.sin(heading))
    y = -radius * (math.cos(heading + turn) - math.cos(heading))
    assert after == Near(Pose(x, y, heading + turn), 1e-6)


@given(headings, distances, turns)
def test_heading_stays_wrapped(heading: float, distance: float, turn: float) -> None:
    assert abs(Pose(0.0, 0.0, heading).moved(distance, turn).heading) <= math.pi


def test_series_and_closed_form_meet() -> None:
    below, above = chord_ratio(SMALL_TURN * 0.999), chord_ratio(SMALL_TURN * 1.001)
    assert below[0] == pytest.approx(above[0], abs=1e-11)
    assert below[1] == pytest.approx(above[1], abs=1e-7)


@given(turns)
def test_the_slope_is_the_derivative(turn: float) -> None:
    step = 1e-5
    numeric = (chord_ratio(turn + step)[0] - chord_ratio(turn - step)[0]) / (2 * step)
    assert chord_ratio(turn)[1] == pytest.approx(numeric, abs=1e-8)


def matrix(covariance: Covariance) -> Matrix:
    rows = list(covariance.rows())
    return [rows[0:3], rows[3:6], rows[6:9]]


def product(a: Matrix, b: Matrix) -> Matrix:
    return [
        [sum(x * y for x, y in zip(row, col, strict=True)) for col in zip(*b, strict=True)]
        for row in a
    ]


def derivative(start: Pose, distance: float, turn: float) -> Matrix:
    """Return d(x, y, heading) after the arc by (x, y, heading, distance, turn), numerically."""
    step = 1e-6
    at = [start.x, start.y, start.heading, distance, turn]
    columns = []
    for i in range(5):
        ends = []
        for sign in (1, -1):
            moved = [value + sign * step * (i == j) for j, value in enumerate(at)]
            ends.append(Pose(*moved[:3]).moved(moved[3], moved[4]))
        turned = math.remainder(ends[0].heading - ends[1].heading, math.tau)
        columns.append(
            [
                (ends[0].x - ends[1].x) / (2 * step),
                (ends[0].y - ends[1].y) / (2 * step),
                turned / (2 * step),
            ]
        )
    return [list(row) for row in zip(*columns, strict=True)]


@given(headings, distances, turns, st.builds(ProcessNoise, variances, variances, variances))
def test_covariance_follows_the_derivatives(
    heading: float, distance: float, turn: float, noise: ProcessNoise
) -> None:
    start = Pose(2.0, 3.0, heading)
    before = CERTAIN.plus(0.3, 1.0, 0.2, 0.1).plus(0.2, -0.3, 1.0, 0.5).plus(0.1, 0.0, 0.0, 1.0)
    after = PoseEstimate(start, before).moved(distance, turn, noise)
    whole = [[*row, 0.0, 0.0] for row in matrix(before)]
    whole += [[0.0, 0.0, 0.0, noise.distance, 0.0], [0.0, 0.0, 0.0, 0.0, noise.turn]]
    by = derivative(start, distance, turn)
    expected = product(product(by, whole), [list(col) for col in zip(*by, strict=True)])
    expected[0][0] += noise.place
    expected[1][1] += noise.place
    for row, wanted in zip(matrix(after.covariance), expected, strict=True):
        assert row == pytest.approx(wanted, abs=1e-6)


def test_an_error_of_heading_leads_aside() -> None:
    before = CERTAIN.plus(0.01, 0.0, 0.0, 1.0)
    after = PoseEstimate(ORIGIN, before).moved(10.0, 0.0, ProcessNoise(0.0, 0.0, 0.0)).covariance
    assert (after.xx, after.yy, after.yh) == pytest.approx((0.0, 1.0, 0.1))
