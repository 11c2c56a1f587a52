"""Ramp: step, start and limits."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.motion import STILL, Twist
from services.safety.core.planning import ramp, ramp_start

UP, DOWN = Twist(0.5, 1.5), Twist(0.6, 1.0)
speeds = st.floats(-2.0, 2.0)


@pytest.mark.parametrize(
    ("current", "target", "after"),
    [
        (0.0, 1.0, 0.05),
        (0.98, 1.0, 1.0),
        (1.0, 0.0, 0.94),
        (0.5, -1.0, 0.44),
        (0.03, -1.0, 0.0),
        (0.0, -1.0, -0.05),
        (-1.0, 0.0, -0.94),
    ],
)
def test_a_ramp_step(current: float, target: float, after: float) -> None:
    assert ramp(Twist(current), Twist(target), UP, DOWN, 0.1).linear == pytest.approx(after)


def test_turning_has_a_ramp_of_its_own() -> None:
    after = ramp(STILL, Twist(1.0, 1.0), UP, DOWN, 0.1)
    assert (after.linear, after.angular) == pytest.approx((0.05, 0.15))


@given(speeds, speeds, st.floats(0.0, 0.1))
def test_a_ramp_never_overshoots(current: float, target: float, dt_s: float) -> None:
    after = ramp(Twist(current), Twist(target), UP, DOWN, dt_s).linear
    assert min(current, target) - 1e-12 <= after <= max(current, target) + 1e-12


@pytest.mark.parametrize(
    ("measured", "target", "begin"),
    [(0.5, 1.0, 0.5), (1.0, 0.5, 0.5), (-0.5, 1.0, 0.0), (0.5, 0.0, 0.0), (-0.5, -1.0, -0.5)],
)
def test_a_ramp_begins_with_what_is_wanted_of_the_motion(
    measured: float, target: float, begin: float
) -> None:
    assert ramp_start(Twist(measured, measured), Twist(target, target)) == Twist(begin, begin)
