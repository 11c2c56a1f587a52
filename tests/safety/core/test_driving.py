"""Requests, ramps, lost bumper samples and missing confirmations, through the whole decision."""

import pytest

from common.freshness import NS_PER_S
from common.motion import STILL
from common.settings import Board
from services.safety.config import SafetyConfig
from services.safety.core.inputs import DriveRequest
from t2.messages import Drive, Switches
from t2.words import render
from tests.safety.core.policy_fixture import PolicyFixture


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
    fixture.now_ns += round(0.05 * NS_PER_S)
    fixture.feed()
    fixture.request(0.5)
    assert fixture.tick(15).command == "run"
    assert fixture.tick().name == "stop"
    assert fixture.request(0.5).command == "run"  # the next request drives on


def test_two_publishers_stop_the_vehicle_until_one_is_left_and_neutral() -> None:
    fixture = PolicyFixture().running()
    fixture.driver_boot, fixture.driver_seq = 100, 0
    fixture.request(0.5)
    assert fixture.refused == "second_publisher"
    assert fixture.verdict.command == "stop"
    assert render(fixture.state.latches["two_publishers"].phrases) == "Two programs send as teleop."
    fixture.driver_boot, fixture.driver_seq = 99, 10_000
    assert fixture.drive(0.5, seconds=0.4).command == "stop"
    assert fixture.drive(0.5, seconds=0.2).name == "inhibited"  # the stick is still pushed
    fixture.drive()
    assert fixture.drive(0.5, seconds=0.1).command == "run"


def test_a_motion_that_stops_has_no_velocity() -> None:
    fixture = PolicyFixture()
    fixture.tick(40)
    fixture.drive(0.5, 0.2)  # without a neutral request
    assert (fixture.verdict.command, fixture.verdict.name) == ("stop", "inhibited")
    assert fixture.verdict.twist == STILL


@pytest.mark.parametrize("zeros_s", [0.0, 0.1])
def test_a_zero_from_before_a_reset_is_not_neutral(zeros_s: float) -> None:
    fixture = PolicyFixture().running()
    fixture.estop()
    fixture.drive(seconds=1.0)
    assert fixture.reset() == ""
    fixture.drive(seconds=zeros_s)
    fixture.drive(0.5, seconds=0.2)
    assert fixture.verdict.name == ("run" if zeros_s else "inhibited")


def test_a_zero_while_a_higher_source_drives_is_not_neutral() -> None:
    fixture = PolicyFixture().running()
    fixture.tick(13)
    fixture.request(source="nav")
    fixture.tick(3)  # the lease of teleop ends, that of nav does not
    assert fixture.request(0.2, source="nav").name == "inhibited"
    fixture.request(source="nav")
    assert fixture.request(0.2, source="nav").name == "run"


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
    text = "teleop (terminal) was in control: nav must let go of the controls, then drive."
    assert fixture.text("neutral") == text
    fixture.request(0.0, source="nav")
    assert fixture.drive(0.2, source="nav").command == "run"


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
        assert fixture.accept(DriveRequest("teleop", drive, received_ns)).twist.is_zero
    assert fixture.verdict.source is None


# --- lost bumper samples --------------------------------------------------------------------


def test_two_lost_bumper_samples_change_nothing_and_three_stop() -> None:
    """Until half a second and a neutral request."""
    fixture = PolicyFixture().running()
    fixture.muted = {"bumper"}
    assert fixture.tick(3).command == "run"
    assert fixture.tick().command == "stop"
    assert render(fixture.state.latches["bumper"].phrases) == "The bumper is not being read."
    fixture.muted = set()
    assert fixture.drive(0.5, seconds=1.0).command == "stop"
    fixture.drive()
    assert fixture.drive(0.5).command == "run"


# --- a board that confirms nothing ----------------------------------------------------------------


def test_a_board_without_echoes_can_be_driven_where_that_is_accepted() -> None:
    accepted = SafetyConfig(board=Board(require_switches=False))
    for settings, command in ((accepted, "run"), (SafetyConfig(), "stop")):
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
