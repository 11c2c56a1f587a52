"""Requests, ramps and zones, through the whole decision."""

import math

import pytest
from msgspec.structs import replace as with_fields

from common.freshness import NS_PER_S
from common.messages import Drive, Switches
from services.safety.config import Safety
from services.safety.inputs import DriveRequest
from services.safety.report import state_message
from tests.safety.policy_fixture import TICK_S, PolicyFixture


def test_requests_are_ramped() -> None:
    fixture = PolicyFixture().ready()
    fixture.drive(1.0, seconds=0.52)  # the first tick comes before the first request
    assert fixture.verdict.twist.linear == pytest.approx(0.25)
    fixture.drive(1.0, seconds=3.0)
    assert fixture.verdict.twist.linear == pytest.approx(1.0)
    fixture.drive(0.0, seconds=0.52)
    assert fixture.verdict.twist.linear == pytest.approx(0.7)


def test_requests_beyond_the_limits_keep_their_curve() -> None:
    fixture = PolicyFixture().running(4.0, 2.0)
    fixture.drive(4.0, 2.0)
    assert fixture.verdict.twist.linear == pytest.approx(1.0)
    assert fixture.verdict.twist.angular == pytest.approx(0.5)


def test_after_a_pause_the_ramp_begins_at_what_is_left_of_the_motion() -> None:
    fixture = PolicyFixture().running(1.0)
    fixture.linear = 0.8
    fixture.tick(20)
    assert fixture.verdict.command == "stop"
    assert fixture.request(1.0).twist.linear == pytest.approx(0.8)


def test_a_request_holds_for_its_lease_and_not_longer() -> None:
    fixture = PolicyFixture().running()
    fixture.now_ns += round(0.1 * NS_PER_S)
    fixture.feed()
    fixture.request(0.5)
    assert fixture.tick(15).command == "run"
    assert fixture.tick().name == "stop"
    assert fixture.request(0.5).command == "run"  # the next request drives on


def test_two_publishers_stop_the_vehicle_until_one_is_left() -> None:
    fixture = PolicyFixture().running()
    fixture.driver_boot, fixture.driver_seq = 100, 0
    assert fixture.request(0.5).refused == "second_publisher"
    assert fixture.verdict.command == "stop"
    fixture.driver_boot, fixture.driver_seq = 99, 10_000
    assert fixture.drive(0.5, seconds=0.4).command == "stop"
    assert fixture.drive(0.5, seconds=0.2).command == "run"


def test_a_refused_request_changes_nothing() -> None:
    fixture = PolicyFixture().running()
    before = fixture.verdict.twist
    assert fixture.decide(DriveRequest("teleop", None, fixture.now_ns)).refused == "not_a_request"
    assert fixture.verdict.twist == before
    nan = Drive(linear=math.nan, angular=0, echo=fixture.state.heartbeat.number)
    assert fixture.decide(DriveRequest("teleop", nan, fixture.now_ns)).refused == "not_finite"
    late = with_fields(nan, linear=0.1, echo=0)
    assert fixture.decide(DriveRequest("teleop", late, fixture.now_ns)).refused == "late"
    assert fixture.verdict.command == "run"


def test_the_higher_priority_drives_and_letting_go_hands_over_after_a_neutral_request() -> None:
    fixture = PolicyFixture().ready()
    fixture.tick(20)
    fixture.drive(source="nav")
    fixture.drive(0.2, source="nav", seconds=1.0)
    assert fixture.verdict.source == "nav"
    assert fixture.request(0.0, source="teleop").command == "run"
    assert fixture.verdict.source == "teleop"
    for _ in range(3):  # while teleop holds the wheel a neutral request does not count
        fixture.request(0.0, source="nav")
        fixture.drive(0.2, source="nav", seconds=0.08)
    fixture.drive(0.2, source="nav", seconds=3.0)
    assert fixture.verdict.source == "nav"
    assert fixture.verdict.name == "inhibited"
    text = "teleop was in control: nav needs a neutral request first."
    assert fixture.state.latches["neutral"].text == text
    fixture.request(0.0, source="nav")
    assert fixture.drive(0.2, source="nav").command == "run"


def test_a_higher_source_takes_control_without_further_conditions() -> None:
    fixture = PolicyFixture().ready()
    fixture.tick(20)
    fixture.drive(source="nav")
    fixture.drive(0.2, source="nav", seconds=1.0)
    assert fixture.drive(0.2, source="teleop", seconds=0.04).command == "run"
    assert fixture.verdict.source == "teleop"


def test_an_old_request_behind_a_queued_zero_moves_nothing() -> None:
    fixture = PolicyFixture().running()
    fixture.tick(150)
    received_ns = fixture.now_ns - 3 * NS_PER_S
    for linear in (0.0, 0.5):
        fixture.driver_seq += 1
        drive = Drive(
            linear=linear, angular=0, echo=fixture.state.heartbeat.number, seq=fixture.driver_seq,
            boot=fixture.driver_boot,
        )  # fmt: skip
        assert fixture.decide(DriveRequest("teleop", drive, received_ns)).twist.is_zero
    assert fixture.verdict.source is None


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


def test_coming_out_of_the_margin_takes_three_samples_and_5_cm() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=0.20)
    fixture.drive(0.5)
    assert fixture.verdict.command == "stop"
    fixture.sonar(front=0.24)
    fixture.drive(0.5, seconds=1.0)
    assert fixture.verdict.command == "stop"
    fixture.sonar(front=0.26)
    assert fixture.drive(0.5, seconds=2 * TICK_S).command == "stop"
    assert fixture.drive(0.5, seconds=2 * TICK_S).command == "run"


def test_a_faulty_sonar_closes_its_sector_only() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=None)
    assert fixture.drive(0.5).command == "stop"
    assert "faulty" in fixture.state.latches["blocked"].text
    assert fixture.drive(-0.5).command == "run"


def test_old_ranges_close_every_sector() -> None:
    fixture = PolicyFixture().ready()
    fixture.muted = {"ultrasonic"}
    fixture.drive(seconds=0.4)
    for linear, angular in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
        assert fixture.drive(linear, angular).command == "stop"
    fixture.muted = set()
    assert fixture.drive(0.5).command == "run"


def test_moving_into_the_margin_against_the_command_stops() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=0.15)
    fixture.linear = 0.2
    assert fixture.drive(-0.5).command == "stop"
    fixture.linear = 0.0
    assert fixture.drive(-0.5).command == "run"


# --- doubt ----------------------------------------------------------------------------------


def beside_a_wall() -> PolicyFixture:
    """Return a fixture with exact readings, the front sonars at their greatest range."""
    fixture = PolicyFixture().ready()
    fixture.sonar(
        left=0.57, front_left=0.8, rear_left=0.8, front=4.5, front_right=4.5, right=1.1,
        rear=2.0, rear_right=1.3,
    )  # fmt: skip
    fixture.drive(seconds=1.5)
    return fixture


def test_exact_readings_beside_a_wall_let_the_vehicle_drive_on() -> None:
    fixture = beside_a_wall()
    for _ in range(6):
        assert fixture.drive(0.5, seconds=5.0).command == "run"
        assert fixture.verdict.twist.linear == pytest.approx(0.5)
    for linear, angular in ((-0.1, 0.0), (0.0, 0.1), (0.0, -0.1)):
        assert fixture.drive(linear, angular, seconds=1.0).command == "run"


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
    assert "front suspect" in fixture.state.latches["sonar"].text
    assert "Creeping toward the front" in fixture.state.latches["obstacle"].text
    assert fixture.drive(-0.5, seconds=2.0).twist.linear == pytest.approx(-0.5)
    fixture.ranges = tuple(1.0 if one else None for one in fixture.ranges)
    fixture.drive(0.2, seconds=1.0)
    assert "sonar" not in fixture.state.latches


def test_the_limits_tell_of_a_creep() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=2.0)
    fixture.drive(0.5, seconds=3.0)
    limits = state_message(fixture.policy, fixture.state, fixture.now_ns).limits
    assert limits.forward == pytest.approx(0.15)
    assert limits.backward == 1.0
    fixture.lost = 3
    fixture.drive(0.5, seconds=0.1)
    limits = state_message(fixture.policy, fixture.state, fixture.now_ns).limits
    assert limits.backward == pytest.approx(0.15)
    assert limits.angular == pytest.approx(0.15 / math.hypot(0.55, 0.35))


def test_an_operator_creeps_past_a_faulty_sonar_after_a_neutral_request() -> None:
    fixture = PolicyFixture().running()
    fixture.sonar(front=None)
    assert fixture.drive(0.5, seconds=3.0).command == "stop"  # held on: nothing moves
    assert "release the controls" in fixture.state.latches["blocked"].text
    fixture.drive()
    assert fixture.drive(0.5, seconds=1.0).name == "slow"
    assert fixture.verdict.twist.linear == pytest.approx(0.15)
    assert "sees nothing there" in fixture.state.latches["obstacle"].text
    assert fixture.drive(-0.5, seconds=1.0).twist.linear < -0.3  # away from it as ever
    fixture.sonar(front=0.1)
    assert fixture.drive(0.1, seconds=1.0).command == "stop"
    fixture.sonar(front=None)
    assert fixture.drive(0.1, seconds=1.0).command == "stop"  # a new fault


def test_no_operator_creeps_while_all_ultrasonic_samples_are_missing() -> None:
    fixture = PolicyFixture().running()
    fixture.muted = {"ultrasonic"}
    fixture.drive(seconds=2.0)
    assert fixture.drive(0.5, seconds=1.0).command == "stop"
    text = fixture.state.latches["blocked"].text
    assert text.startswith("No motion toward the ")
    assert text.endswith(" is silent.")


def test_missing_ultrasonic_samples_end_a_creep_past_a_faulty_sonar() -> None:
    fixture = PolicyFixture().running()
    fixture.sonar(front=None)
    fixture.drive(seconds=2.0)
    assert fixture.drive(0.5).name == "slow"
    fixture.muted = {"ultrasonic"}
    assert fixture.drive(0.5, seconds=0.4).command == "stop"
    fixture.muted = set()
    assert fixture.drive(0.5, seconds=2.0).command == "stop"  # its operator must acknowledge again
    fixture.drive()
    assert fixture.drive(0.5).name == "slow"


def test_a_neutral_request_before_the_fault_was_shown_for_a_second_does_not_count() -> None:
    fixture = PolicyFixture().ready()
    fixture.sonar(front=None)
    fixture.drive(seconds=0.9)
    assert fixture.drive(0.3, seconds=2.0).command == "stop"


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


# --- lost bumper polls ----------------------------------------------------------------------


def test_three_lost_bumper_polls_limit_all_motion_to_the_creep_speed() -> None:
    fixture = PolicyFixture().running()
    for lost, slow in ((2, False), (3, True), (2, True), (3, True), (1, False), (2, False)):
        fixture.lost = lost
        fixture.drive(0.5, seconds=0.1)
        assert ("bumper_lossy" in fixture.state.latches) is slow, lost
        assert fixture.verdict.command == "run"
    fixture.lost = 3
    assert fixture.drive(0.5, seconds=1.0).twist.linear == pytest.approx(0.15)
    assert fixture.drive(0.0, 0.8, seconds=1.0).twist.angular == pytest.approx(
        0.15 / math.hypot(0.55, 0.35)
    )
    assert fixture.verdict.name == "slow"


def test_more_lost_bumper_polls_stop_until_half_a_second_and_a_neutral_request() -> None:
    fixture = PolicyFixture().running()
    fixture.lost = 4
    assert fixture.tick().command == "stop"
    assert fixture.state.latches["bumper"].text == "4 bumper polls of 0.2 s were lost."
    fixture.lost = 0
    assert fixture.drive(0.5, seconds=1.0).command == "stop"
    fixture.drive()
    assert fixture.drive(0.5).command == "run"


# --- a board without echoes -----------------------------------------------------------------


def test_a_board_without_echoes_can_be_driven_where_that_is_accepted() -> None:
    accepted = Safety(require_switches=False, unsafe_overrides=("require_switches",))
    for settings, command in ((accepted, "run"), (Safety(), "stop")):
        fixture = PolicyFixture(settings)
        fixture.muted = {"switches"}
        fixture.tick(40)
        fixture.drive()
        assert fixture.drive(0.3).command == command
        fixture.switches = Switches()
        fixture.muted = set()
        fixture.drive()
        assert fixture.drive(0.3).command == command
    fixture = PolicyFixture(accepted).running()
    fixture.muted = {"switches"}
    assert fixture.drive(0.3, seconds=5.0).command == "run"
