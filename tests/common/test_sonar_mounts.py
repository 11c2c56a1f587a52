"""Where the sonars sit and look."""

import math

import pytest

from common.messages import SONAR_NAMES
from common.settings import Mount, Vehicle, sonar_mounts


def test_the_sonars_stand_in_the_manuals_order() -> None:
    assert tuple(mount.name for mount in sonar_mounts(Vehicle())) == SONAR_NAMES


def test_the_sonars_go_round_clockwise_from_the_left() -> None:
    degrees = [round(math.degrees(mount.yaw)) for mount in sonar_mounts(Vehicle())]
    assert degrees == [90, 45, 0, -45, -90, -135, 180, 135]


@pytest.mark.parametrize(
    "mount", sonar_mounts(Vehicle(length=2.0, width=1.0)), ids=lambda m: m.name
)
def test_a_sonar_sits_on_the_edge_and_looks_out(mount: Mount) -> None:
    assert abs(mount.x) == 1.0 or abs(mount.y) == 0.5
    outward = mount.x * math.cos(mount.yaw) + mount.y * math.sin(mount.yaw)
    assert outward > 0
    assert ("left" in mount.name) == (mount.y > 0)
    assert ("front" in mount.name) == (mount.x > 0)
