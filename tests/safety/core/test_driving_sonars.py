"""Sonars through the whole decision: zones, suspect and faulty sonars."""

import math

import pytest

from common.motion import Twist
from t2.messages import SONAR_NAMES
from tests.safety.core.policy_fixture import TICK_S, PolicyFixture

# --- zones ----------------------------------------------------------------------------------


def test_an_obstacle_slows_and_the_margin_stops() -> None:
    fixture = PolicyFixture().running(1.0)
    fixture.sonar(front=1.0)
    assert fixture.drive(1.0).name == "slow"
    assert 0 < fixture.verdict.twist.linear < 1.0
    fixture.linear = 0.0
    fixture.sonar(front=0.20)
    assert fixture.drive(1.0).name == "stop"
    assert "blocked" in fixture.state.latches
    assert fixture.drive(-0.3).command == "run"  # the way out stays open


TWISTS = [Twist(0.3), Twist(-0.3), Twist(0, 0.3), Twist(0, -0.3), Twist(0.3, 0.3), Twist(-0.3, 0.3)]


def closes_in(name: str, twist: Twist) -> bool:
    """Return whether a twist moves the vehicle, 1.10 by 0.70 m, toward what a sonar sees."""
    ahead = name.startswith("front") - name.startswith("rear")
    aside = name.endswith("left") - name.endswith("right")
    yaw = math.atan2(aside, ahead)
    x, y = 0.55 * ahead, 0.35 * aside
    along = (twist.linear - twist.angular * y) * math.cos(yaw) + twist.angular * x * math.sin(yaw)
    return along > 1e-6 or (name in ("left", "right") and twist.angular != 0)


@pytest.mark.parametrize("distance", [0.2, None])
@pytest.mark.parametrize("name", SONAR_NAMES)
def test_a_blocked_or_faulty_sonar_blocks_each_twist_toward_it(
    name: str, distance: float | None
) -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(**{name: distance})
    for twist in TWISTS:
        verdict = fixture.drive(twist.linear, twist.angular)
        assert (verdict.name == "stop") is closes_in(name, twist), twist
        fixture.linear = fixture.angular = 0.0
        fixture.tick()
        fixture.linear = fixture.angular = None


def test_a_faulty_sonar_closes_its_sector_only() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=None)
    assert fixture.drive(0.5).command == "stop"
    assert "faulty" in fixture.text("blocked")
    assert fixture.drive(-0.5).command == "run"


def test_old_ranges_close_every_sector() -> None:
    fixture = PolicyFixture().ready()
    fixture.muted = {"ultrasonic"}
    fixture.drive(seconds=0.4)
    for linear, angular in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
        assert fixture.drive(linear, angular).command == "stop"
    fixture.muted = set()
    assert fixture.drive(0.5).command == "run"


# --- doubt ----------------------------------------------------------------------------------


def beside_a_wall() -> PolicyFixture:
    """Return a fixture with exact readings, and no echo in front."""
    fixture = PolicyFixture().ready()
    fixture.sonar(
        left=0.57, front_left=0.8, rear_left=0.8, right=1.1, rear=2.0, rear_right=1.3,
    )  # fmt: skip
    fixture.drive(seconds=1.5)
    return fixture


@pytest.mark.no_cover
def test_exact_readings_beside_a_wall_let_the_vehicle_drive_on() -> None:
    fixture = beside_a_wall()
    for _ in range(6):
        assert fixture.drive(0.5, seconds=5.0).command == "run"
        assert fixture.verdict.twist.linear == pytest.approx(0.5)
    for linear, angular in ((-0.1, 0.0), (0.0, 0.1), (0.0, -0.1)):
        assert fixture.drive(linear, angular, seconds=1.0).command == "run"


def test_sensors_with_another_greatest_range_than_the_setting_creep_and_are_not_blocked() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(**dict.fromkeys(SONAR_NAMES, 3.0))
    assert fixture.drive(0.5, seconds=4.0).twist.linear == pytest.approx(0.15)
    assert "sonar" in fixture.state.latches
    assert fixture.drive(-0.5, seconds=4.0).command == "run"


@pytest.mark.parametrize("frozen_m", [2.0, 1.2])
def test_a_frozen_front_sonar_creeps_before_the_wall(frozen_m: float) -> None:
    fixture = PolicyFixture().running(1.0)
    fixture.sonar(front=frozen_m)
    wall_m = fixture.distance + frozen_m
    for _ in range(150):
        fixture.drive(1.0, seconds=TICK_S)
        # The vehicle obeys at once here; a real one needs the way to slow down.
        speed, room_m = fixture.verdict.twist.linear, wall_m - fixture.distance
        assert speed <= 0.151 or speed * 0.25 + speed**2 / (2 * 0.6) < room_m
    assert fixture.verdict.twist.linear == pytest.approx(0.15)
    assert "sonar" in fixture.state.latches
    assert "front (suspect)" in fixture.text("sonar")
    assert "Creeping toward the front" in fixture.text("obstacle")
    assert fixture.drive(-0.5, seconds=2.0).twist.linear == pytest.approx(-0.5)
    fixture.ranges = tuple(1.0 if one else None for one in fixture.ranges)
    fixture.drive(0.2, seconds=1.0)
    assert "sonar" not in fixture.state.latches


def test_the_limits_tell_of_a_creep() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=2.0)
    fixture.drive(0.5, seconds=3.0)
    limits = fixture.published().limits
    assert limits.forward == pytest.approx(0.15)
    assert limits.backward == 1.0


def test_an_operator_creeps_past_a_faulty_sonar_after_a_neutral_request() -> None:
    fixture = PolicyFixture().running()
    fixture.sonar(front=None)
    assert fixture.drive(0.5, seconds=3.0).command == "stop"  # held on: nothing moves
    assert "let go of the controls" in fixture.text("blocked")
    fixture.drive()
    assert fixture.drive(0.5, seconds=1.0).name == "slow"
    assert fixture.verdict.twist.linear == pytest.approx(0.15)
    assert "sees nothing there" in fixture.text("obstacle")
    assert fixture.drive(-0.5, seconds=1.0).twist.linear < -0.3  # away from it as ever
    fixture.sonar(front=0.1)
    assert fixture.drive(0.1, seconds=1.0).command == "stop"
    fixture.sonar(front=None)
    assert fixture.drive(0.1, seconds=1.0).command == "stop"  # a new fault


def test_a_source_without_an_operator_never_passes_a_faulty_sonar() -> None:
    fixture = PolicyFixture().ready()
    fixture.tick(20)
    fixture.sonar(front=None)
    fixture.drive(source="nav", seconds=3.0)
    assert fixture.drive(0.3, source="nav", seconds=1.0).command == "stop"
    assert "blocked" in fixture.state.latches


def test_moving_fast_toward_a_sonar_that_shows_nothing_stops() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=None)
    fixture.drive(seconds=2.0)
    fixture.linear = 0.34
    assert fixture.drive(0.15, seconds=0.1).command == "run"
    fixture.linear = 0.36
    assert fixture.drive(0.15, seconds=0.04).command == "stop"


def test_what_is_too_near_to_measure_is_an_obstacle_for_everybody() -> None:
    fixture = PolicyFixture().ready()
    fixture.status = ("no_echo", "no_echo", "too_near", *(("no_echo",) * 5))
    fixture.drive(seconds=3.0)
    assert fixture.drive(0.1, seconds=1.0).command == "stop"
    assert fixture.drive(-0.1, seconds=1.0).command == "run"
