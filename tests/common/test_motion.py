import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.motion import Twist, clamp


@given(st.floats(allow_nan=False), st.floats(0, 1e6))
def test_clamp(value: float, limit: float) -> None:
    assert abs(clamp(value, limit)) <= limit
    assert clamp(clamp(value, limit), limit) == clamp(value, limit)
    assert clamp(-limit - 1.0, limit) == -limit


@pytest.mark.parametrize(
    ("linear", "angular", "standing"),
    [(0.019, 0.049, True), (0.02, 0.0, False), (0.0, -0.05, False), (math.nan, 0.0, False)],
)
def test_a_measured_twist_is_standing(linear: float, angular: float, standing: bool) -> None:
    assert Twist(linear, angular).is_standing == standing


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_twist_within_limits_keeps_its_curve(linear: float, angular: float) -> None:
    twist = Twist(linear, angular)
    inside = twist.within(1.0, 0.5)
    assert abs(inside.linear) <= 1.0 + 1e-9
    assert abs(inside.angular) <= 0.5 + 1e-9
    assert inside.linear * angular == pytest.approx(inside.angular * linear)
    if abs(linear) <= 1.0 and abs(angular) <= 0.5:
        assert inside == twist
    assert Twist(0.8, 0.2).within(0.4, 0.5) == Twist(0.4, 0.1)
