import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.motion import clamp, is_standing


@pytest.mark.parametrize(
    ("linear", "angular", "stands"),
    [
        (0.0, 0.0, True), (0.0199, 0.0, True), (0.02, 0.0, False), (-0.02, 0.0, False),
        (0.0, 0.049, True), (0.0, 0.05, False), (0.0, -0.05, False),
    ],
)  # fmt: skip
def test_standing(linear: float, angular: float, stands: bool) -> None:
    assert is_standing(linear, angular) is stands


@given(st.floats(allow_nan=False), st.floats(0, 1e6))
def test_clamp(value: float, limit: float) -> None:
    assert abs(clamp(value, limit)) <= limit
    assert clamp(clamp(value, limit), limit) == clamp(value, limit)
