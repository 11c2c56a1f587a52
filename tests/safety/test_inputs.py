"""Inputs: values that are not finite count as unknown."""

import math

import pytest

from common.freshness import Latest
from common.messages import Mileage, Velocity
from common.motion import Twist
from services.safety.inputs import Inputs
from services.safety.trajectory import Counter


def test_a_velocity_is_unknown_until_it_is_a_number() -> None:
    assert Inputs().measured is None
    for linear, known in ((math.nan, None), (0.5, Twist(0.5, 0.0))):
        velocity = Latest(Velocity(linear=linear, angular=0.0), 0)
        assert Inputs(velocity=velocity).measured == known


@pytest.mark.parametrize(
    ("distance", "heading", "known"),
    [(1.0, 2.0, True), (math.nan, 0.0, False), (0.0, math.inf, False), (-math.inf, 0.0, False)],
)
def test_counters_are_unknown_until_they_are_numbers(
    distance: float, heading: float, known: bool
) -> None:
    assert Inputs().counter is None
    mileage = Mileage(distance=distance, heading=heading, epoch=3, boot=9)
    counter = Inputs(mileage=Latest(mileage, 0)).counter
    assert counter == (Counter((9, 3), distance, heading) if known else None)
