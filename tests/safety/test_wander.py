"""Wandering through the office: a sonar that saturates must not immobilise the vehicle.

``python -m verification.vehicles.wander`` prints the figures of longer runs.
"""

import pytest

from verification.vehicles.wander import run

pytestmark = pytest.mark.campaign


@pytest.mark.parametrize(("saturation", "seed"), [(5.0, 0), (3.0, 0), (3.0, 1)])
def test_the_vehicle_goes_on_moving_and_hits_nothing(saturation: float, seed: int) -> None:
    figures = run(seed, saturation, seconds=25.0)
    assert not figures.immobile
    assert figures.moving > 0.5
    assert figures.contacts == 0
