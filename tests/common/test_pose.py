"""Poses against closed forms and matrices, arcs, and covariances in other axes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.pose import Covariance, Pose, chord_ratio
from tests.odom.core.odom_fixture import apart

CLOSE = pytest.approx((0.0, 0.0), abs=1e-9)
QUARTER = math.pi / 2
poses = st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9), st.floats(-math.pi, math.pi))
factors = st.lists(st.floats(-2, 2), min_size=9, max_size=9)


@pytest.mark.parametrize("turn", [9e-5, -9e-5, 1.1e-4, 0.01])
def test_the_chord_of_a_small_turn(turn: float) -> None:
    ratio, derivative = chord_ratio(turn)
    assert (1.0 - ratio) / turn**2 == pytest.approx(1 / 24, rel=1e-3)
    assert derivative / turn == pytest.approx(-1 / 12, rel=1e-3)


@pytest.mark.parametrize(
    ("start", "distance", "turn", "end"),
    [
        ((1.0, 2.0, QUARTER), 3.0, 0.0, (1.0, 5.0, QUARTER)),  # straight on
        ((0.0, 0.0, 0.0), QUARTER, QUARTER, (1.0, 1.0, QUARTER)),  # a quarter circle to the left
        ((0.0, 0.0, 0.0), -QUARTER, QUARTER, (-1.0, -1.0, QUARTER)),  # backward
        ((1.0, 1.0, 0.0), 0.0, 2.0, (1.0, 1.0, 2.0)),  # turning on the spot
        ((0.0, 0.0, 0.0), math.tau, math.tau, (0.0, 0.0, 0.0)),  # a full circle
    ],
)
def test_known_arcs(
    start: tuple[float, float, float],
    distance: float,
    turn: float,
    end: tuple[float, float, float],
) -> None:
    assert apart(Pose(*start).moved(distance, turn), Pose(*end)) == CLOSE


def matrix(pose: Pose) -> np.ndarray:
    """Return a pose as a homogeneous matrix."""
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return np.array([[cos, -sin, pose.x], [sin, cos, pose.y], [0.0, 0.0, 1.0]])


@given(poses, poses)
def test_poses_combine_and_invert_as_matrices_do(a: Pose, b: Pose) -> None:
    assert matrix(a.then(b)) == pytest.approx(matrix(a) @ matrix(b), abs=1e-9)
    assert matrix(a.inverse()) == pytest.approx(np.linalg.inv(matrix(a)), abs=1e-9)
    assert -math.pi <= a.then(b).heading <= math.pi


@given(factors, st.floats(-math.pi, math.pi))
def test_a_covariance_turns_with_its_axes(values: list[float], angle: float) -> None:
    root = np.array(values).reshape(3, 3)
    full = root @ root.T
    turned = Covariance.of([float(each) for each in full.ravel()]).rotated(angle)
    rotation = matrix(Pose(0.0, 0.0, angle))
    assert np.array(turned.rows()).reshape(3, 3) == pytest.approx(
        rotation @ full @ rotation.T, abs=1e-9
    )
    largest = math.sqrt(np.linalg.eigvalsh(full[:2, :2])[-1])
    assert turned.sigma == pytest.approx(largest, abs=1e-6)
    assert turned.heading_sigma == pytest.approx(math.sqrt(full[2, 2]))


@given(st.floats(0.1, 2.0), st.floats(0.01, 0.09), st.floats(-math.pi / 2, math.pi / 2))
def test_the_ellipse_of_a_covariance(longer: float, shorter: float, direction: float) -> None:
    upright = Covariance(longer**2, 0.0, shorter**2, 0.0, 0.0, 0.0)
    half_axes = upright.rotated(direction).ellipse
    assert half_axes[:2] == pytest.approx((longer, shorter), abs=1e-6)
    assert math.sin(half_axes[2] - direction) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("xx", "xy", "yy", "half_axes"),
    [
        (9.0, 0.0, 4.0, (3.0, 2.0, 0.0)),
        (4.0, 0.0, 9.0, (3.0, 2.0, QUARTER)),
        (5.0, 4.0, 5.0, (3.0, 1.0, QUARTER / 2)),
    ],
)
def test_known_ellipses(
    xx: float, xy: float, yy: float, half_axes: tuple[float, float, float]
) -> None:
    assert Covariance(xx, xy, yy, 0.0, 0.0, 0.0).ellipse == pytest.approx(half_axes)


def test_covariances_add_and_subtract() -> None:
    one = Covariance(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert one.combined(one) == Covariance(2.0, 4.0, 6.0, 8.0, 10.0, 12.0)
    assert one.combined(one, -1.0) == Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert Covariance.of(one.rows()) == one
    less = Covariance(-1.0, 0.0, -1.0, 0.0, 0.0, -1.0)
    assert less.sigma == less.heading_sigma == 0.0
