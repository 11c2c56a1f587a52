"""Inputs: values that are not finite count as unknown."""

import math

import pytest

from common.freshness import Latest
from common.messages import Mileage, Velocity
from common.motion import Twist
from services.safety.core.inputs import Inputs


def test_a_velocity_is_unknown_until_it_is_a_number() -> None:
    assert Inputs().measured is None
    for linear, known in ((math.nan, None), (0.5, Twist(0.5, 0.0))):
        velocity = Latest(Velocity(linear=linear, angular=0.0), 0)
        assert Inputs(velocity=velocity).measured == (Latest(known, 0) if known else None)


@pytest.mark.parametrize(
    ("distance", "heading", "known"),
    [(1.0, 2.0, True), (math.nan, 0.0, False), (0.0, math.inf, False), (-math.inf, 0.0, False)],
)
def test_counters_are_unknown_until_they_are_numbers(
    distance: float, heading: float, known: bool
) -> None:
    assert Inputs().counters is None
    mileage = Latest(Mileage(distance=distance, heading=heading, epoch=3, boot=9), 0)
    assert Inputs(mileage=mileage).counters is (mileage if known else None)
