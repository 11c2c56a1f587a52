"""Planning: allowed speeds, the geometry of each sonar, and the ramp."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from common.motion import RUN, STILL, Twist
from common.settings import Vehicle, sonar_mounts
from services.safety.config import DECISION_PERIOD_S, Safety, SafetyConfig
from services.safety.core.planning import (
    GRAZING,
    Planner,
    RequestedTwist,
    Zones,
    ramp,
    ramp_start,
    zones,
)
from services.safety.core.policy import Policy
from services.safety.core.sonar import Sonar
from services.safety.core.sonars import SonarArray
from services.safety.core.state import State, Verdict
from t2.messages import SONAR_NAMES

FIELD_S, SHIPPED_S = 0.25, 0.27  # from reading to slowing down, with the wait for a decision
ALLOWED_AT_1M = math.sqrt((0.6 * FIELD_S) ** 2 + 2 * 0.6 * 0.8) - 0.6 * FIELD_S
ALLOWED_AT_03 = math.sqrt((0.6 * SHIPPED_S) ** 2 + 2 * 0.6 * 0.1) - 0.6 * SHIPPED_S

distances = st.tuples(*[st.floats(0.0, 6.0) | st.just(math.inf)] * 8)
twists = st.builds(Twist, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@pytest.fixture(scope="module")
def field() -> Zones:
    return zones(SafetyConfig(safety=Safety(react=FIELD_S - DECISION_PERIOD_S)))


def test_the_field_is_that_of_the_vehicle_and_the_settings() -> None:
    vehicle = Vehicle(length=1.2, width=0.8, deceleration=0.5)
    field = zones(SafetyConfig(vehicle=vehicle, safety=Safety(margin=0.3, react=0.2)))
    assert (field.margin, field.deceleration) == (0.3, 0.5)
    assert field.react == pytest.approx(0.22)
    assert field.angular_deceleration == 1.0
    assert [axis.swing for axis in field.axes] == [0.6, 0, 0, 0, 0.6, 0, 0, 0]


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_sonar_closes_in_as_its_place_moves_along_the_way_it_looks(
    field: Zones, linear: float, angular: float
) -> None:
    for sonar, mount in enumerate(sonar_mounts(Vehicle())):
        along = math.cos(mount.yaw), math.sin(mount.yaw)
        driving = linear * along[0]
        turning = angular * (mount.x * along[1] - mount.y * along[0])
        axis = field.axes[sonar]
        assert axis.along(Twist(linear, angular)) == pytest.approx(driving + turning, abs=1e-12)
        if mount.name in ("left", "right"):
            turning = abs(angular) * Vehicle().length / 2
        approach = axis.approach(Twist(linear, angular))
        assert approach == pytest.approx((driving, turning), abs=1e-12)


@pytest.mark.parametrize("decelerations", [(0.6, 1.0), (0.6, 0.1), (0.1, 3.0)])
@given(twist=st.builds(Twist, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)))
def test_a_stop_stays_in_its_room_whichever_axis_ends_first(
    field: Zones, decelerations: tuple[float, float], twist: Twist
) -> None:
    """Both axes slow down together, or each one by itself: the way along the sonar's axis."""
    linear, angular = decelerations
    field = replace(field, deceleration=linear, angular_deceleration=angular)
    for name, axis in zip(SONAR_NAMES, field.axes, strict=True):
        slower = twist.scaled(field.limit(twist, only(name, 0.6)).factor)
        times = abs(slower.linear) / linear, abs(slower.angular) / angular
        parts = axis.approach(slower)
        reacting = 0.25 * max(0.0, sum(parts))
        together = sum(parts) * max(times) / 2
        apart = travels(parts, times)
        assert reacting + max(together, apart) <= 0.4 + 1e-3  # of the integration


def test_a_turn_away_that_ends_before_the_drive_is_limited(field: Zones) -> None:
    """Weak angular brakes, and the other way round: what approaches ends last."""
    weak = replace(field, angular_deceleration=0.1)
    retreats = Twist(0.2, -1.0)  # toward the rear left only by turning
    assert sum(weak.axes[7].approach(retreats)) == pytest.approx(0.0, abs=1e-3)
    assert weak.limit(retreats, only("rear_left", 0.3)).factor < 0.5
    strong = replace(field, angular_deceleration=3.0)
    assert strong.limit(Twist(-1.0, 3.0), only("rear_left", 0.3)).factor < 0.5


def travels(parts: tuple[float, float], times: tuple[float, float], steps: int = 200) -> float:
    """Return the farthest way of two speeds that fall to zero in these times, step by step."""
    end_s, way, farthest = max(times), 0.0, 0.0
    for step in range(steps):
        now_s = end_s * (step + 0.5) / steps
        left = [max(0.0, 1 - now_s / time_s) if time_s else 0.0 for time_s in times]
        way += (parts[0] * left[0] + parts[1] * left[1]) * end_s / steps
        farthest = max(farthest, way)
    return farthest


def only(name: str, distance: float) -> tuple[float, ...]:
    return tuple(distance if one == name else math.inf for one in SONAR_NAMES)


@given(st.floats(0.01, 10.0), st.floats(0.01, 10.0))
def test_nothing_is_exactly_nothing_whatever_the_settings(
    field: Zones, react: float, deceleration: float
) -> None:
    other = replace(field, react=react, deceleration=deceleration)
    assert other.limit(Twist(0.5, 0.1), only("front", 0.2)).factor == 0.0


# Decelerations of the settings (m/s^2 and rad/s^2), and a reading (m) with 0.4 m of room.
TURNING = [(0.6, 1.0), (0.6, 0.4), (0.6, 0.1), (0.1, 3.0), (1.0, 0.1)]


@pytest.mark.parametrize(("deceleration", "angular_deceleration"), TURNING)
@given(twist=st.builds(Twist, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)))
def test_reacting_and_stopping_takes_the_room_there_is(
    field: Zones, deceleration: float, angular_deceleration: float, twist: Twist
) -> None:
    """Both axes slow down together, so the slower one gives the time."""
    field = replace(field, deceleration=deceleration, angular_deceleration=angular_deceleration)
    for name, axis in zip(SONAR_NAMES, field.axes, strict=True):
        limit = field.limit(twist, only(name, 0.6))
        slower = twist.scaled(limit.factor)
        stop_s = max(abs(slower.linear) / deceleration, abs(slower.angular) / angular_deceleration)
        needed = sum(axis.approach(slower)) * (0.25 + stop_s / 2)
        assert needed <= 0.4 + 1e-9
        if limit.sonar is not None and min(axis.approach(slower)) >= 0:
            assert needed == pytest.approx(0.4)


def test_a_weak_angular_deceleration_slows_a_turn_beside_a_wall(field: Zones) -> None:
    field = replace(field, angular_deceleration=0.4)
    for name in ("left", "right"):
        assert field.limit(Twist(0.0, 1.0), only(name, 0.6)).factor == pytest.approx(
            0.669, abs=1e-3
        )


@pytest.mark.parametrize(("speed", "room"), [(0.0, 0.2), (0.15, 0.25625), (1.0, 1.2833333)])
def test_the_room_of_a_speed_is_where_it_is_allowed(
    field: Zones, speed: float, room: float
) -> None:
    assert field.room(speed) == pytest.approx(room)
    limit = field.limit(Twist(10.0), only("front", field.room(speed)))
    assert 10.0 * limit.factor == pytest.approx(speed)
    assert replace(field, react=0.5, deceleration=0.4).room(0.2) == pytest.approx(0.35)


@pytest.mark.parametrize(("speed", "factor"), [(GRAZING, 1.0), (2 * GRAZING, 0.0)])
def test_grazing_is_no_approach(field: Zones, speed: float, factor: float) -> None:
    assert field.limit(Twist(speed, 0.0), only("front", 0.0)).factor == factor


def test_the_first_of_two_equally_near_is_named(field: Zones) -> None:
    left, right = SONAR_NAMES.index("front_left"), SONAR_NAMES.index("front_right")
    ranges = tuple(0.4 if n in (left, right) else math.inf for n in range(8))
    assert field.limit(Twist(1.0, 0.0), ranges).sonar == min(left, right)


@given(twists, distances)
def test_a_limited_twist_is_allowed_toward_every_sonar(
    field: Zones, twist: Twist, ranges: tuple[float, ...]
) -> None:
    limited = twist.scaled(field.limit(twist, ranges).factor)
    assert field.limit(limited, ranges).factor == pytest.approx(1.0, abs=1e-5) or limited.is_zero


@given(twists, distances)
def test_a_limited_twist_stays_on_its_curve(
    field: Zones, twist: Twist, ranges: tuple[float, ...]
) -> None:
    factor = field.limit(twist, ranges).factor
    assert 0.0 <= factor <= 1.0
    limited = twist.scaled(factor)
    assert limited.linear * twist.angular == pytest.approx(limited.angular * twist.linear)


@pytest.mark.parametrize(
    ("distance", "measured", "stops"),
    [
        (0.20, 0.05, False),
        (0.20, 0.051, True),
        (0.20, -1.0, False),
        (1.00, ALLOWED_AT_1M + 0.199, False),
        (1.00, ALLOWED_AT_1M + 0.201, True),
    ],
)
def test_measured_motion_has_its_own_bounds(
    field: Zones, distance: float, measured: float, stops: bool
) -> None:
    sonar = field.too_fast(Twist(measured, 0.0), only("front", distance))
    assert sonar == (SONAR_NAMES.index("front") if stops else None)


@pytest.mark.parametrize(("angular_deceleration", "stops"), [(1.0, False), (0.1, True)])
def test_a_measured_turn_is_judged_by_its_own_deceleration(
    field: Zones, angular_deceleration: float, stops: bool
) -> None:
    field = replace(field, angular_deceleration=angular_deceleration)
    sonar = field.too_fast(Twist(0.0, 0.8), only("left", 0.6))
    assert sonar == (SONAR_NAMES.index("left") if stops else None)


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


def test_a_sonar_that_is_grazed_hides_no_other_one(field: Zones) -> None:
    near = [1.0] * 8
    near[SONAR_NAMES.index("front")] = 0.25
    assert field.too_fast(Twist(1.0, 0.01), near) == SONAR_NAMES.index("front")


# --- a plan ---------------------------------------------------------------------------------


def planner() -> Planner:
    return Planner(SafetyConfig())


def test_it_reaches_from_the_middle_to_the_corners() -> None:
    assert Planner(SafetyConfig(vehicle=Vehicle(length=0.8, width=0.6))).reach == 0.5


def under_way(sent: Twist, seen: tuple[float, ...]) -> State:
    """Return a state in which a twist was sent, and the sonars see these distances."""
    sonars = tuple(Sonar(distance=one, fault="") for one in seen)
    state = Policy(SafetyConfig()).start()
    verdict = Verdict(command=RUN, twist=sent)
    array = SonarArray.of(sonars, planner().creep_room, (1, 1), 0)
    return replace(state, verdict=verdict, sonar_array=array)


@pytest.mark.parametrize(
    ("front", "linear", "blocked"),
    [(math.inf, 0.49, False), (0.3, ALLOWED_AT_03, False), (0.1, 0.0, True)],
)
def test_the_motion_that_is_left_on_the_ramp_obeys_the_sonars(
    front: float, linear: float, blocked: bool
) -> None:
    """A turn on the spot is requested, which approaches nothing in front."""
    state = under_way(Twist(0.5, 0.5), only("front", front))
    turn = RequestedTwist("teleop", Twist(0.0, 0.5))
    plan = planner().plan(state, STILL, turn, 0.01 / 0.6)
    assert plan.twist.linear == pytest.approx(linear, abs=1e-9)
    assert (plan.blocked_by is not None) is blocked


def test_a_turn_slows_down_at_its_own_deceleration() -> None:
    state = under_way(Twist(0.0, 0.5), only("front", math.inf))
    plan = planner().plan(state, STILL, RequestedTwist("teleop", STILL), 0.1)
    assert (plan.twist.linear, plan.twist.angular) == pytest.approx((0.0, 0.4))
