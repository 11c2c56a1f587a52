"""Held keys and raw stick values to deflections, and deflections to twists."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.motion import Twist
from services.teleop.config import GEARS, Teleop
from services.teleop.controls import (
    DIRECTIONS,
    Deflection,
    deflection,
    shaped,
    twist,
)

SETTINGS = Teleop()


@pytest.mark.parametrize(
    ("held", "push"),
    [
        ([], (0, 0)),
        (["w"], (1, 0)),
        (["down"], (-1, 0)),
        (["a"], (0, 1)),
        (["right"], (0, -1)),
        (["w", "a"], (1, 1)),
        (["z"], (1, 1)),
        (["c"], (1, -1)),
        (["w", "s"], (0, 0)),
        (["w", "up"], (1, 0)),  # twice the same is not twice as fast
        (["z", "w", "a"], (1, 1)),
        (["s", "a"], (-1, 1)),
        (["end"], (-1, -1)),  # the tail goes left
        (["pagedown"], (-1, 1)),
    ],
)
def test_keys_give_a_direction(held: list[str], push: tuple[float, float]) -> None:
    assert deflection(held) == Deflection(*push)


@given(st.lists(st.sampled_from(sorted(DIRECTIONS))))
def test_keys_never_exceed_full_deflection(held: list[str]) -> None:
    push = deflection(held)
    assert abs(push.linear) <= 1
    assert abs(push.angular) <= 1


@pytest.mark.parametrize(
    ("gear", "turbo", "expected"),
    [
        (1, False, Twist(0.2, 0.3)),
        (5, False, Twist(0.8, 0.9)),
        (1, True, Twist(1.0, 1.0)),
        (5, True, Twist(1.0, 1.0)),
    ],
)
def test_the_gear_sets_the_speed(gear: int, turbo: bool, expected: Twist) -> None:
    assert twist(Deflection(1, 1), gear, turbo, SETTINGS) == expected
    assert twist(Deflection(), gear, turbo, SETTINGS) == Twist()


def test_each_gear_is_faster() -> None:
    speeds = [twist(Deflection(1, 1), gear, False, SETTINGS) for gear in range(1, GEARS + 1)]
    assert [speed.linear for speed in speeds] == sorted({speed.linear for speed in speeds})


@pytest.mark.parametrize(
    ("raw", "expo", "expected"),
    [
        (0.0, 0.5, 0.0),
        (0.1, 0.0, 0.0),
        (-0.1, 0.0, 0.0),
        (1.0, 0.5, 1.0),
        (-1.0, 0.5, -1.0),
        (1.5, 1.0, 1.0),
        (0.55, 0.0, 0.5),
        (0.55, 1.0, 0.125),
        (-0.55, 1.0, -0.125),
        (math.nan, 0.5, 0.0),
        (math.inf, 0.5, 0.0),
    ],
)
def test_a_stick_has_a_deadzone_and_full_deflection(
    raw: float, expo: float, expected: float
) -> None:
    both = shaped(Deflection(raw, raw), 0.1, expo)
    assert both.linear == pytest.approx(expected)
    assert both.angular == pytest.approx(expected)


@given(st.floats(), st.floats(0.02, 0.5), st.floats(0, 1))
def test_a_stick_never_exceeds_full_deflection(raw: float, deadzone: float, expo: float) -> None:
    assert -1 <= shaped(Deflection(raw, 0), deadzone, expo).linear <= 1
