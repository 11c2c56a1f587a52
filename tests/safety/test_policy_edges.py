"""The policy where one wrong sign or number would show: ages, edges, what is remembered."""

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES
from common.motion import STILL
from services.safety.config import Safety
from services.safety.core.causes import FAILURES, RULES, Held
from tests.safety.policy_fixture import TICK_S, PolicyFixture, hit


def test_a_decision_without_a_request_refuses_none() -> None:
    fixture = PolicyFixture().ready()
    assert fixture.decide().refused == ""


def test_an_old_velocity_is_no_runaway() -> None:
    fixture = PolicyFixture().ready()
    fixture.linear = 0.9
    fixture.tick()
    fixture.muted = {"velocity"}
    fixture.tick(40)
    assert "silent" in fixture.state.latches
    assert "runaway" not in fixture.state.latches


def test_a_reading_that_stays_the_same_while_driving_limits_to_the_creep_speed() -> None:
    fixture = PolicyFixture()
    fixture.sonar(front=3.0)
    assert fixture.ready().drive(0.3, seconds=1.0).name == "run"
    assert fixture.drive(0.3, seconds=1.5).name == "slow"
    assert fixture.state.sonar_array.sonars[SONAR_NAMES.index("front")].suspect
    assert fixture.verdict.twist.linear == pytest.approx(0.15)


def test_being_pushed_off_the_bumper_uses_up_no_way() -> None:
    fixture = hit()
    fixture.linear = 0.3
    fixture.tick(5)
    assert fixture.state.release.travelled == 0.0


@pytest.mark.parametrize(
    ("linear", "angular", "trips"),
    [
        (0.79, 0.5, False), (0.81, 0.5, True), (-0.09, 0.5, False), (-0.11, 0.5, True),
        (0.5, 0.99, False), (0.5, 1.01, True), (0.5, -0.19, False), (0.5, -0.21, True),
    ],
)  # fmt: skip
def test_a_runaway_is_one_of_either_axis(linear: float, angular: float, trips: bool) -> None:
    fixture = PolicyFixture().running(0.5, 0.5)
    fixture.linear, fixture.angular = linear, angular
    fixture.drive(0.5, 0.5, seconds=0.28)
    assert "runaway" not in fixture.state.latches
    fixture.drive(0.5, 0.5, seconds=0.04)
    assert ("runaway" in fixture.state.latches) is trips


def test_two_publishers_are_named() -> None:
    fixture = PolicyFixture().running()
    fixture.driver_boot, fixture.driver_seq = 100, 0
    fixture.request(0.5)
    held = fixture.state.latches["two_publishers"]
    assert held.text == "Two publishers use teleop."
    assert held.token == (0, fixture.now_ns)


def test_what_no_sample_shows_is_known_by_the_time() -> None:
    fixture = PolicyFixture().running(0.5)
    fixture.linear = 0.9
    fixture.drive(0.5, seconds=0.4)
    assert fixture.state.latches["runaway"].token == (0, fixture.now_ns)


def test_the_first_bumper_sample_follows_none() -> None:
    """Numbers start anywhere: only between two samples can one be lost."""
    fixture = PolicyFixture()
    fixture.seq = 1000
    fixture.tick()
    assert "bumper" not in fixture.state.latches


def test_a_pause_of_the_process_does_not_leap_the_ramp() -> None:
    fixture = PolicyFixture().ready()
    before = fixture.drive(0.5).twist.linear
    fixture.now_ns += NS_PER_S // 8
    fixture.feed()
    after = fixture.request(0.5).twist.linear
    assert after - before == pytest.approx(0.05)


@pytest.mark.parametrize(("late_ns", "command"), [(0, "run"), (1, "stop")])
def test_samples_queued_during_a_stall_are_not_fresh(late_ns: int, command: str) -> None:
    fixture = PolicyFixture().running()
    fixture.now_ns += round(Safety().bumper_age * NS_PER_S) + late_ns
    fixture.feed()
    fixture.state = replace(fixture.state, heartbeat=fixture.state.heartbeat.beat(fixture.now_ns))
    assert fixture.request(0.5).command == command
    if late_ns:
        assert "stalled" in fixture.state.latches["silent"].text
        assert fixture.drive(0.5, seconds=2.0).command == "stop"
        fixture.drive()
    assert fixture.drive(0.5).command == "run"


def test_a_held_cause_knows_since_when() -> None:
    fixture = PolicyFixture().ready()
    lease_ticks = round(0.3 / TICK_S)
    fixture.tick(lease_ticks)
    assert "no_request" not in fixture.state.latches
    fixture.tick()
    since_ns = fixture.now_ns
    fixture.tick(3)
    now_ns = fixture.now_ns
    held = fixture.state.latches["no_request"]
    assert held == Held(since_ns, now_ns, 0, (0, now_ns), "No source requests motion.", held.id)


def test_flapping_knows_since_when() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(int(FAILURES)):
        fixture.tick(40)
        fixture.muted = {"bumper"}
        fixture.tick(9)
        fixture.muted = set()
    held = fixture.state.latches["flapping"]
    assert fixture.now_ns - NS_PER_S // 10 < held.since_ns < held.bad_ns == fixture.now_ns
    assert held.token == (0, fixture.now_ns)


def test_a_cause_is_identified_by_the_decision_in_which_it_began() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(int(FAILURES)):
        fixture.tick(40)
        fixture.muted = {"bumper"}
        for _ in range(9):
            fixture.tick()
            if "flapping" in fixture.state.latches:
                break
        else:
            fixture.muted = set()
    for name in ("flapping", "no_request"):
        assert fixture.state.latches[name].id // len(RULES) > 0
    assert fixture.state.latches["flapping"].id // len(RULES) == fixture.state.decision


def test_room_is_not_looked_for_while_motion_is_barred() -> None:
    fixture = PolicyFixture().running()
    fixture.estop()
    fixture.linear = 0.0
    fixture.sonar(front=0.1)
    assert fixture.drive(0.5).command == "brake"
    assert "blocked" not in fixture.state.latches
    assert fixture.verdict.twist == STILL


def test_a_request_that_is_stopped_commands_no_motion() -> None:
    fixture = PolicyFixture()
    fixture.tick(40)
    fixture.drive(0.5)
    assert fixture.tick().name == "inhibited"  # time has passed, so that a ramp would have begun
    assert "neutral" in fixture.state.latches
    assert fixture.verdict.twist == STILL


def test_nothing_creeps_while_two_publishers_are_active() -> None:
    fixture = hit()
    assert fixture.hold() == ""
    assert "release" in fixture.state.latches
    fixture.driver_boot, fixture.driver_seq = 100, 0
    assert fixture.request(0.0).refused == "second_publisher"
    assert fixture.verdict.command == "brake"  # the release ends, and the bumper is still pressed
    assert "release" not in fixture.state.latches
