"""Requests, ramps and zones, through the whole decision."""

import math

import pytest
from msgspec.structs import replace as with_fields

from common.freshness import S
from common.messages import Drive
from services.safety.inputs import Ask
from tests.safety.scene import TICK_S, Scene


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
    scene.now_ns += round(0.1 * S)
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
    assert scene.decide(Ask("teleop", None)).refused == "not_a_request"
    assert scene.verdict.twist == before
    nan = Drive(linear=math.nan, angular=0, echo=scene.state.heartbeat.number)
    assert scene.decide(Ask("teleop", nan)).refused == "not_finite"
    late = with_fields(nan, linear=0.1, echo=0)
    assert scene.decide(Ask("teleop", late)).refused == "late"
    assert scene.verdict.command == "run"


def test_the_higher_priority_drives_and_letting_go_hands_over() -> None:
    scene = Scene().ready()
    scene.drive(source="nav")
    scene.tick(20)
    scene.drive(0.2, source="nav", seconds=1.0)
    assert scene.verdict.source == "nav"
    scene.ask(0.0, source="teleop")
    assert scene.verdict.source == "teleop"
    scene.drive(0.2, source="nav", seconds=0.4)
    assert scene.verdict.source == "nav"
    assert scene.verdict.command == "run"


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
