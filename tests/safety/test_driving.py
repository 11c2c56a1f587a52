"""Requests, ramps and zones, through the whole decision."""

import math

import pytest
from msgspec.structs import replace as with_fields

from common.freshness import NS_PER_S
from common.messages import Drive, Switches
from services.safety.config import Safety
from services.safety.inputs import Ask
from services.safety.report import state_message
from tests.safety.policy_fixture import TICK_S, Scene


def test_requests_are_ramped() -> None:
    scene = Scene().ready()
    scene.drive(1.0, seconds=0.52)  # the first tick comes before the first request
    assert scene.verdict.twist.linear == pytest.approx(0.25)
    scene.drive(1.0, seconds=3.0)
    assert scene.verdict.twist.linear == pytest.approx(1.0)
    scene.drive(0.0, seconds=0.52)
    assert scene.verdict.twist.linear == pytest.approx(0.7)


def test_requests_beyond_the_limits_keep_their_curve() -> None:
    scene = Scene().running(4.0, 2.0)
    scene.drive(4.0, 2.0)
    assert scene.verdict.twist.linear == pytest.approx(1.0)
    assert scene.verdict.twist.angular == pytest.approx(0.5)


def test_after_a_pause_the_ramp_begins_at_what_is_left_of_the_motion() -> None:
    scene = Scene().running(1.0)
    scene.linear = 0.8
    scene.tick(20)
    assert scene.verdict.command == "stop"
    assert scene.ask(1.0).twist.linear == pytest.approx(0.8)


def test_a_request_holds_for_its_lease_and_not_longer() -> None:
    scene = Scene().running()
    scene.now_ns += round(0.1 * NS_PER_S)
    scene.feed()
    scene.ask(0.5)
    assert scene.tick(15).command == "run"
    assert scene.tick().name == "stop"
    assert scene.ask(0.5).command == "run"  # the next request drives on


def test_two_publishers_stop_the_vehicle_until_one_is_left() -> None:
    scene = Scene().running()
    scene.driver_boot, scene.driver_seq = 100, 0
    assert scene.ask(0.5).refused == "second_publisher"
    assert scene.verdict.command == "stop"
    scene.driver_boot, scene.driver_seq = 99, 10_000
    assert scene.drive(0.5, seconds=0.4).command == "stop"
    assert scene.drive(0.5, seconds=0.2).command == "run"


def test_a_refused_request_changes_nothing() -> None:
    scene = Scene().running()
    before = scene.verdict.twist
    assert scene.decide(Ask("teleop", None, scene.now_ns)).refused == "not_a_request"
    assert scene.verdict.twist == before
    nan = Drive(linear=math.nan, angular=0, echo=scene.state.heartbeat.number)
    assert scene.decide(Ask("teleop", nan, scene.now_ns)).refused == "not_finite"
    late = with_fields(nan, linear=0.1, echo=0)
    assert scene.decide(Ask("teleop", late, scene.now_ns)).refused == "late"
    assert scene.verdict.command == "run"


def test_the_higher_priority_drives_and_letting_go_hands_over_after_a_neutral_request() -> None:
    scene = Scene().ready()
    scene.tick(20)
    scene.drive(source="nav")
    scene.drive(0.2, source="nav", seconds=1.0)
    assert scene.verdict.source == "nav"
    assert scene.ask(0.0, source="teleop").command == "run"
    assert scene.verdict.source == "teleop"
    for _ in range(3):  # while teleop holds the wheel a neutral request does not count
        scene.ask(0.0, source="nav")
        scene.drive(0.2, source="nav", seconds=0.08)
    scene.drive(0.2, source="nav", seconds=3.0)
    assert scene.verdict.source == "nav"
    assert scene.verdict.name == "inhibited"
    text = "teleop has driven: nav needs a neutral request first."
    assert scene.state.latches["neutral"].text == text
    scene.ask(0.0, source="nav")
    assert scene.drive(0.2, source="nav").command == "run"


def test_who_takes_the_wheel_from_below_needs_nothing_more() -> None:
    scene = Scene().ready()
    scene.tick(20)
    scene.drive(source="nav")
    scene.drive(0.2, source="nav", seconds=1.0)
    assert scene.drive(0.2, source="teleop", seconds=0.04).command == "run"
    assert scene.verdict.source == "teleop"


def test_an_old_request_behind_a_queued_zero_moves_nothing() -> None:
    scene = Scene().running()
    scene.tick(150)
    received_ns = scene.now_ns - 3 * NS_PER_S
    for linear in (0.0, 0.5):
        scene.driver_seq += 1
        drive = Drive(
            linear=linear, angular=0, echo=scene.state.heartbeat.number, seq=scene.driver_seq,
            boot=scene.driver_boot,
        )  # fmt: skip
        assert scene.decide(Ask("teleop", drive, received_ns)).twist.is_zero
    assert scene.verdict.source is None


# --- zones ----------------------------------------------------------------------------------


def test_an_obstacle_slows_and_the_margin_stops() -> None:
    scene = Scene().running(1.0)
    scene.sonar(front=1.0)
    assert scene.drive(1.0).name == "slow"
    assert 0 < scene.verdict.twist.linear < 1.0
    scene.linear = 0.0
    scene.sonar(front=0.20)
    assert scene.drive(1.0).name == "stop"
    assert "blocked" in scene.state.latches
    assert scene.drive(-0.3).command == "run"  # the way out stays open


def test_coming_out_of_the_margin_takes_three_samples_and_5_cm() -> None:
    scene = Scene().ready()
    scene.sonar(front=0.20)
    scene.drive(0.5)
    assert scene.verdict.command == "stop"
    scene.sonar(front=0.24)
    scene.drive(0.5, seconds=1.0)
    assert scene.verdict.command == "stop"
    scene.sonar(front=0.26)
    assert scene.drive(0.5, seconds=2 * TICK_S).command == "stop"
    assert scene.drive(0.5, seconds=2 * TICK_S).command == "run"


def test_a_faulty_sonar_closes_its_sector_only() -> None:
    scene = Scene().ready()
    scene.sonar(front=None)
    assert scene.drive(0.5).command == "stop"
    assert "faulty" in scene.state.latches["blocked"].text
    assert scene.drive(-0.5).command == "run"


def test_old_ranges_close_every_sector() -> None:
    scene = Scene().ready()
    scene.muted = {"ultrasonic"}
    scene.drive(seconds=0.4)
    for linear, angular in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
        assert scene.drive(linear, angular).command == "stop"
    scene.muted = set()
    assert scene.drive(0.5).command == "run"


def test_moving_into_the_margin_against_the_command_stops() -> None:
    scene = Scene().ready()
    scene.sonar(front=0.15)
    scene.linear = 0.2
    assert scene.drive(-0.5).command == "stop"
    scene.linear = 0.0
    assert scene.drive(-0.5).command == "run"


# --- doubt ----------------------------------------------------------------------------------


def beside_a_wall() -> Scene:
    """Return a scene with exact readings, the front sonars at their greatest range."""
    scene = Scene().ready()
    scene.sonar(
        left=0.57, front_left=0.8, rear_left=0.8, front=4.5, front_right=4.5, right=1.1,
        rear=2.0, rear_right=1.3,
    )  # fmt: skip
    scene.drive(seconds=1.5)
    return scene


def test_exact_readings_beside_a_wall_let_the_vehicle_drive_on() -> None:
    scene = beside_a_wall()
    for _ in range(6):
        assert scene.drive(0.5, seconds=5.0).command == "run"
        assert scene.verdict.twist.linear == pytest.approx(0.5)
    for linear, angular in ((-0.1, 0.0), (0.0, 0.1), (0.0, -0.1)):
        assert scene.drive(linear, angular, seconds=1.0).command == "run"


@pytest.mark.parametrize("frozen_m", [2.0, 1.2])
def test_a_frozen_front_sonar_creeps_before_the_wall(frozen_m: float) -> None:
    scene = Scene().running(1.0)
    scene.sonar(front=frozen_m)
    wall_m = scene.distance + frozen_m
    for _ in range(150):
        scene.drive(1.0, seconds=TICK_S)
        # The vehicle obeys at once here; a real one needs the way to slow down.
        speed, room_m = scene.verdict.twist.linear, wall_m - scene.distance
        assert speed <= 0.151 or speed * 0.25 + speed**2 / (2 * 0.6) < room_m
    assert scene.verdict.twist.linear == pytest.approx(0.15)
    assert "sonar" in scene.state.latches
    assert "front suspect" in scene.state.latches["sonar"].text
    assert "Creeping toward the front" in scene.state.latches["obstacle"].text
    assert scene.drive(-0.5, seconds=2.0).twist.linear == pytest.approx(-0.5)
    scene.ranges = tuple(1.0 if one else None for one in scene.ranges)
    scene.drive(0.2, seconds=1.0)
    assert "sonar" not in scene.state.latches


def test_the_limits_tell_of_a_creep() -> None:
    scene = Scene().ready()
    scene.sonar(front=2.0)
    scene.drive(0.5, seconds=3.0)
    limits = state_message(scene.policy, scene.state, scene.now_ns).limits
    assert limits.forward == pytest.approx(0.15)
    assert limits.backward == 1.0
    scene.lost = 3
    scene.drive(0.5, seconds=0.1)
    limits = state_message(scene.policy, scene.state, scene.now_ns).limits
    assert limits.backward == pytest.approx(0.15)
    assert limits.angular == pytest.approx(0.15 / math.hypot(0.55, 0.35))


def test_an_operator_creeps_past_a_faulty_sonar_after_a_neutral_request() -> None:
    scene = Scene().running()
    scene.sonar(front=None)
    assert scene.drive(0.5, seconds=3.0).command == "stop"  # held on: nothing moves
    assert "release the controls" in scene.state.latches["blocked"].text
    scene.drive()
    assert scene.drive(0.5, seconds=1.0).name == "slow"
    assert scene.verdict.twist.linear == pytest.approx(0.15)
    assert "nothing is seen there" in scene.state.latches["obstacle"].text
    assert scene.drive(-0.5, seconds=1.0).twist.linear < -0.3  # away from it as ever
    scene.sonar(front=0.1)
    assert scene.drive(0.1, seconds=1.0).command == "stop"
    scene.sonar(front=None)
    assert scene.drive(0.1, seconds=1.0).command == "stop"  # a new fault


def test_no_operator_creeps_while_all_ultrasonic_samples_are_missing() -> None:
    scene = Scene().running()
    scene.muted = {"ultrasonic"}
    scene.drive(seconds=2.0)
    assert scene.drive(0.5, seconds=1.0).command == "stop"
    text = scene.state.latches["blocked"].text
    assert text.startswith("No motion toward the ")
    assert text.endswith(" is silent.")


def test_missing_ultrasonic_samples_end_a_creep_past_a_faulty_sonar() -> None:
    scene = Scene().running()
    scene.sonar(front=None)
    scene.drive(seconds=2.0)
    assert scene.drive(0.5).name == "slow"
    scene.muted = {"ultrasonic"}
    assert scene.drive(0.5, seconds=0.4).command == "stop"
    scene.muted = set()
    assert scene.drive(0.5, seconds=2.0).command == "stop"  # its operator must acknowledge again
    scene.drive()
    assert scene.drive(0.5).name == "slow"


def test_a_neutral_request_before_the_fault_was_shown_for_a_second_does_not_count() -> None:
    scene = Scene().ready()
    scene.sonar(front=None)
    scene.drive(seconds=0.9)
    assert scene.drive(0.3, seconds=2.0).command == "stop"


def test_a_source_without_an_operator_never_passes_a_faulty_sonar() -> None:
    scene = Scene().ready()
    scene.tick(20)
    scene.sonar(front=None)
    scene.drive(source="nav", seconds=3.0)
    assert scene.drive(0.3, source="nav", seconds=1.0).command == "stop"
    assert "blocked" in scene.state.latches


def test_moving_fast_toward_a_sonar_that_shows_nothing_stops() -> None:
    scene = Scene().ready()
    scene.sonar(front=None)
    scene.drive(seconds=2.0)
    scene.linear = 0.34
    assert scene.drive(0.15, seconds=0.1).command == "run"
    scene.linear = 0.36
    assert scene.drive(0.15, seconds=0.04).command == "stop"


def test_what_is_too_near_to_measure_is_an_obstacle_for_everybody() -> None:
    scene = Scene().ready()
    scene.status = ("no_echo", "no_echo", "too_near", *(("no_echo",) * 5))
    scene.drive(seconds=3.0)
    assert scene.drive(0.1, seconds=1.0).command == "stop"
    assert scene.drive(-0.1, seconds=1.0).command == "run"


# --- lost bumper polls ----------------------------------------------------------------------


def test_three_lost_bumper_polls_limit_all_motion_to_the_creep_speed() -> None:
    scene = Scene().running()
    for lost, slow in ((2, False), (3, True), (2, True), (3, True), (1, False), (2, False)):
        scene.lost = lost
        scene.drive(0.5, seconds=0.1)
        assert ("bumper_lossy" in scene.state.latches) is slow, lost
        assert scene.verdict.command == "run"
    scene.lost = 3
    assert scene.drive(0.5, seconds=1.0).twist.linear == pytest.approx(0.15)
    assert scene.drive(0.0, 0.8, seconds=1.0).twist.angular == pytest.approx(
        0.15 / math.hypot(0.55, 0.35)
    )
    assert scene.verdict.name == "slow"


def test_more_lost_bumper_polls_stop_until_half_a_second_and_a_neutral_request() -> None:
    scene = Scene().running()
    scene.lost = 4
    assert scene.tick().command == "stop"
    assert scene.state.latches["bumper"].text == "4 bumper polls of 0.2 s were lost."
    scene.lost = 0
    assert scene.drive(0.5, seconds=1.0).command == "stop"
    scene.drive()
    assert scene.drive(0.5).command == "run"


# --- a board without echoes -----------------------------------------------------------------


def test_a_board_without_echoes_can_be_driven_where_that_is_accepted() -> None:
    accepted = Safety(require_switches=False, unsafe_overrides=("require_switches",))
    for settings, command in ((accepted, "run"), (Safety(), "stop")):
        scene = Scene(settings)
        scene.muted = {"switches"}
        scene.tick(40)
        scene.drive()
        assert scene.drive(0.3).command == command
        scene.switches = Switches()
        scene.muted = set()
        scene.drive()
        assert scene.drive(0.3).command == command
    scene = Scene(accepted).running()
    scene.muted = {"switches"}
    assert scene.drive(0.3, seconds=5.0).command == "run"
