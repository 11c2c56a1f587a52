"""The filter against its textbook form, with matrices of NumPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.pose import Covariance, Pose
from services.localization.core.estimate import (
    POSE,
    POSITION,
    ROUNDING,
    Located,
    Measured,
    Sample,
    Transform,
    inverse,
)

poses = st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9), st.floats(-3.0, 3.0))
factors = st.lists(st.floats(-1, 1), min_size=9, max_size=9)


def covariance(values: list[float]) -> Covariance:
    """Return a positive definite covariance."""
    root = np.array(values).reshape(3, 3)
    return Covariance.of([float(it) for it in (root @ root.T + 0.1 * np.eye(3)).ravel()])


def array(of: Covariance) -> np.ndarray:
    return np.array(of.rows()).reshape(3, 3)


@given(poses, factors, poses, factors, st.sampled_from([POSITION, POSE]))
def test_a_fix_corrects_as_a_kalman_filter_does(
    pose: Pose, own: list[float], fixed: Pose, other: list[float], values: int
) -> None:
    located = Located(pose, covariance(own))
    fix = Measured(fixed, covariance(other), values)
    observe = np.eye(3)[:values]
    residual = np.array(
        [fixed.x - pose.x, fixed.y - pose.y, math.remainder(fixed.heading - pose.heading, math.tau)]
    )[:values]
    total = observe @ (array(located.covariance) + array(fix.covariance)) @ observe.T
    gain = array(located.covariance) @ observe.T @ np.linalg.inv(total)
    step = gain @ residual
    after = located.corrected(fix)
    assert located.distance(fix) == pytest.approx(residual @ np.linalg.inv(total) @ residual)
    assert (after.pose.x - pose.x, after.pose.y - pose.y) == pytest.approx(step[:2], abs=1e-9)
    assert math.remainder(after.pose.heading - pose.heading - step[2], math.tau) == pytest.approx(
        0.0, abs=1e-9
    )
    expected = (np.eye(3) - gain @ observe) @ array(located.covariance)
    assert array(after.covariance) == pytest.approx(expected, abs=1e-9)


@given(poses, factors, poses, factors)
def test_a_transform_reproduces_the_pose_at_its_sample(
    pose: Pose, own: list[float], odom: Pose, other: list[float]
) -> None:
    located, sample = Located(pose, covariance(own)), Sample(1, odom, covariance(other), 0)
    again = Transform.of(located, sample).at(sample)
    assert (again.pose.x, again.pose.y) == pytest.approx((pose.x, pose.y), abs=1e-9)
    assert array(again.covariance) == pytest.approx(array(located.covariance), abs=1e-9)


@pytest.mark.parametrize(
    ("rows", "values", "is_possible"),
    [
        ((1, 0, 0, 0, 1, 0, 0, 0, 1), POSE, True),
        ((1, 0, 0, 0, 1, 0, 0, 0, 0), POSE, False),
        ((1, 0, 0, 0, 1, 0, 0, 0, 0), POSITION, True),
        ((1, 2, 0, 2, 1, 0, 0, 0, 1), POSITION, False),  # correlated by more than 1
        ((-1, 0, 0, 0, -1, 0, 0, 0, 1), POSITION, False),
        ((1, 0, 2, 0, 1, 0, 2, 0, 1), POSE, False),
    ],
)
def test_a_covariance_must_be_positive_definite(
    rows: tuple[float, ...], values: int, is_possible: bool
) -> None:
    pose = Pose(0.0, 0.0, 0.0)
    assert Measured(pose, Covariance.of(rows), values).is_possible == is_possible


def test_matrices_of_two_and_three_rows_are_inverted() -> None:
    assert inverse([[2.0, 1.0], [1.0, 2.0]]) == pytest.approx(
        np.linalg.inv([[2.0, 1.0], [1.0, 2.0]])
    )
    three = [[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]]
    assert np.array(inverse(three)) == pytest.approx(np.linalg.inv(three))


@pytest.mark.parametrize(
    ("xx", "yy", "hh", "is_step"),
    [
        (0.0, 0.0, 0.0, True),
        (-ROUNDING, 0.0, 0.0, True),
        (-0.5, 0.25, 0.125, False),
        (0.5, -0.25, 0.125, False),
        (0.5, 0.25, -0.125, False),
    ],
)
def test_odometry_that_becomes_more_certain_adds_no_certainty(
    xx: float, yy: float, hh: float, is_step: bool
) -> None:
    here, certain = Pose(0.0, 0.0, 0.0), Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    before = Sample(1, here, certain, 0)
    after = Sample(2, here, Covariance(xx, 0.1, yy, 0.0, 0.0, hh), 0).after(before, certain)
    expected = Covariance(xx, 0.1, yy, 0.0, 0.0, hh)
    if not is_step:
        expected = Covariance(abs(xx), 0.0, abs(yy), 0.0, 0.0, abs(hh))
    assert after.covariance == expected


def test_halfway_is_on_the_arc() -> None:
    certain = Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    pose = Sample(1, Pose(0.0, 0.0, 0.0), certain, 0, step=(1.0, 0.6)).halfway().pose
    radius = 1.0 / 0.6
    expected = radius * math.sin(0.3), radius * (1 - math.cos(0.3)), 0.3
    assert (pose.x, pose.y, pose.heading) == pytest.approx(expected)
