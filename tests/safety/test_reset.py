"""What a reset wants besides that the causes are gone."""

import math

import pytest

from common.freshness import S
from services.safety.latches import latched
from tests.safety.scene import Scene

UNKNOWN = "It is not known whether the vehicle stands: its velocity is not heard."


def test_a_trip_during_a_reset_wins() -> None:
    scene = Scene().running()
    scene.linear = 0.0
    scene.estop()
    scene.tick(20)
    scene.pressed = True
    scene.feed()
    assert "Not gone yet" in scene.reset()
    assert set(latched(scene.state.latches)) == {"estop", "contact"}


@pytest.mark.parametrize(
    ("linear", "angular", "reason"),
    [
        (0.02, 0.0, "The vehicle still moves."),
        (0.0, -0.05, "The vehicle still moves."),
        (math.nan, 0.0, UNKNOWN),
        (0.019, 0.049, ""),
    ],
)
def test_a_reset_wants_the_vehicle_to_stand(linear: float, angular: float, reason: str) -> None:
    scene = Scene().running()
    scene.estop()
    scene.linear = 0.0
    scene.tick(20)
    scene.linear, scene.angular = linear, angular
    scene.tick()
    assert scene.reset() == reason


def test_a_reset_wants_a_velocity_that_is_young() -> None:
    scene = Scene().running()
    scene.linear = 0.0
    scene.estop()
    scene.tick(20)
    scene.muted = {"velocity"}
    scene.now_ns += round(0.2 * S) + 1
    scene.feed()
    assert scene.reset() == UNKNOWN
    scene.now_ns -= 1
    assert scene.reset() == ""


def test_a_reset_of_nothing_is_no_error() -> None:
    assert Scene().ready().reset() == ""
