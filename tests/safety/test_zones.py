"""Allowed speeds: the formula, the geometry of each sonar, and what holds for any twist."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.messages import SONAR_NAMES
from common.settings import Vehicle
from services.safety.config import Safety
from services.safety.twist import Twist
from services.safety.zones import zones

VEHICLE = Vehicle()
ZONES = zones(VEHICLE, Safety())
FREE = (math.inf,) * 8

distances = st.tuples(*[st.floats(0.0, 6.0) | st.just(math.inf)] * 8)
twists = st.builds(Twist, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


def only(name: str, distance: float) -> tuple[float, ...]:
    return tuple(distance if one == name else math.inf for one in SONAR_NAMES)


@pytest.mark.parametrize("distance", [0.0, 0.1, 0.199999, 0.2])
def test_inside_the_margin_nothing_is_allowed(distance: float) -> None:
    assert ZONES.allowed(distance) == 0.0


@given(st.floats(0.2, 10.0))
def test_reacting_and_stopping_takes_the_room_there_is(distance: float) -> None:
    speed = ZONES.allowed(distance)
    assert speed * 0.25 + speed**2 / (2 * 0.6) == pytest.approx(distance - 0.2, abs=1e-9)


@given(st.floats(0.0, 6.0), st.floats(0.0, 6.0))
def test_nearer_is_never_faster(one: float, other: float) -> None:
    near, far = sorted((one, other))
    assert ZONES.allowed(near) <= ZONES.allowed(far)


@pytest.mark.parametrize(
    ("name", "twist", "approach"),
    [
        ("front", Twist(1.0, 0.0), 1.0),
        ("rear", Twist(1.0, 0.0), -1.0),
        ("front_left", Twist(1.0, 0.0), math.sqrt(0.5)),
        ("rear_right", Twist(-1.0, 0.0), math.sqrt(0.5)),
        ("front", Twist(0.0, 1.0), 0.0),
        ("front_left", Twist(0.0, 1.0), (0.55 - 0.35) * math.sqrt(0.5)),
        ("front_right", Twist(0.0, 1.0), (0.35 - 0.55) * math.sqrt(0.5)),
        ("left", Twist(0.0, 1.0), 0.55),
        ("left", Twist(0.0, -1.0), 0.55),
        ("right", Twist(0.0, 1.0), 0.55),
        ("left", Twist(1.0, 0.0), 0.0),
    ],
)
def test_how_fast_a_sonar_closes_in(name: str, twist: Twist, approach: float) -> None:
    assert ZONES.approach(SONAR_NAMES.index(name), twist) == pytest.approx(approach, abs=1e-12)


def test_a_wall_at_the_flank_lets_the_vehicle_pass_but_not_turn() -> None:
    wall = only("left", 0.1)
    assert ZONES.limit(Twist(1.0, 0.0), wall).factor == 1.0
    assert ZONES.limit(Twist(0.0, 0.5), wall).factor == 0.0
    assert ZONES.limit(Twist(0.5, -0.5), wall).sonar == SONAR_NAMES.index("left")


def test_free_space_limits_nothing() -> None:
    assert ZONES.limit(Twist(1.0, 1.0), FREE).factor == 1.0
    assert ZONES.limit(Twist(1.0, 1.0), FREE).sonar is None


@given(twists, distances)
def test_a_limited_twist_is_allowed_toward_every_sonar(
    twist: Twist, ranges: tuple[float, ...]
) -> None:
    limited = twist.scaled(ZONES.limit(twist, ranges).factor)
    for sonar, distance in enumerate(ranges):
        assert ZONES.approach(sonar, limited) <= ZONES.allowed(distance) + 1e-5


@given(twists, distances)
def test_a_limited_twist_stays_on_its_curve(twist: Twist, ranges: tuple[float, ...]) -> None:
    factor = ZONES.limit(twist, ranges).factor
    assert 0.0 <= factor <= 1.0
    limited = twist.scaled(factor)
    assert limited.linear * twist.angular == pytest.approx(limited.angular * twist.linear)


@given(distances, st.floats(0.01, 1.0))
def test_the_way_out_stays_open(ranges: tuple[float, ...], speed: float) -> None:
    behind_free = tuple(
        math.inf if name.startswith("rear") else distance
        for name, distance in zip(SONAR_NAMES, ranges, strict=True)
    )
    assert ZONES.limit(Twist(-speed, 0.0), behind_free).factor == 1.0


@pytest.mark.parametrize(
    ("distance", "measured", "stops"),
    [
        (0.20, 0.05, False),
        (0.20, 0.051, True),
        (0.20, -1.0, False),
        (1.00, ZONES.allowed(1.0) + 0.199, False),
        (1.00, ZONES.allowed(1.0) + 0.201, True),
    ],
)
def test_measured_motion_has_its_own_bounds(distance: float, measured: float, stops: bool) -> None:
    sonar = ZONES.too_fast(Twist(measured, 0.0), only("front", distance))
    assert sonar == (SONAR_NAMES.index("front") if stops else None)
