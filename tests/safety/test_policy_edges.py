"""The policy where one wrong sign or number would show: ages, edges, what is remembered."""

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES
from common.motion import STILL
from services.safety.causes import RULES
from services.safety.config import Safety
from services.safety.fault_budget import FAILURES
from services.safety.latches import Held
from tests.safety.policy_fixture import TICK_S, Scene, hit


def test_a_decision_without_a_request_refuses_none() -> None:
    scene = Scene().ready()
    assert scene.decide().refused == ""


def test_an_old_velocity_is_no_runaway() -> None:
    scene = Scene().ready()
    scene.linear = 0.9
    scene.tick()
    scene.muted = {"velocity"}
    scene.tick(40)
    assert "silent" in scene.state.latches
    assert "runaway" not in scene.state.latches


def test_a_reading_that_stays_the_same_while_driving_limits_to_the_creep_speed() -> None:
    scene = Scene()
    scene.sonar(front=3.0)
    assert scene.ready().drive(0.3, seconds=1.0).name == "run"
    assert scene.drive(0.3, seconds=1.5).name == "slow"
    assert scene.state.heard.sonars[SONAR_NAMES.index("front")].suspect
    assert scene.verdict.twist.linear == pytest.approx(0.15)


def test_being_pushed_off_the_bumper_uses_up_no_way() -> None:
    scene = hit()
    scene.linear = 0.3
    scene.tick(5)
    assert scene.state.release.travelled == 0.0


@pytest.mark.parametrize(
    ("linear", "angular", "trips"),
    [
        (0.79, 0.5, False), (0.81, 0.5, True), (-0.09, 0.5, False), (-0.11, 0.5, True),
        (0.5, 0.99, False), (0.5, 1.01, True), (0.5, -0.19, False), (0.5, -0.21, True),
    ],
)  # fmt: skip
def test_a_runaway_is_one_of_either_axis(linear: float, angular: float, trips: bool) -> None:
    scene = Scene().running(0.5, 0.5)
    scene.linear, scene.angular = linear, angular
    scene.drive(0.5, 0.5, seconds=0.28)
    assert "runaway" not in scene.state.latches
    scene.drive(0.5, 0.5, seconds=0.04)
    assert ("runaway" in scene.state.latches) is trips


def test_two_publishers_are_named() -> None:
    scene = Scene().running()
    scene.driver_boot, scene.driver_seq = 100, 0
    scene.ask(0.5)
    held = scene.state.latches["two_publishers"]
    assert held.text == "Two publishers ask on teleop."
    assert held.token == (0, scene.now_ns)


def test_what_no_sample_shows_is_known_by_the_time() -> None:
    scene = Scene().running(0.5)
    scene.linear = 0.9
    scene.drive(0.5, seconds=0.4)
    assert scene.state.latches["runaway"].token == (0, scene.now_ns)


def test_the_first_bumper_sample_follows_none() -> None:
    """Numbers start anywhere: only between two samples can one be lost."""
    scene = Scene()
    scene.seq = 1000
    scene.tick()
    assert "bumper" not in scene.state.latches


def test_a_pause_of_the_process_does_not_leap_the_ramp() -> None:
    scene = Scene().ready()
    before = scene.drive(0.5).twist.linear
    scene.now_ns += NS_PER_S // 8
    scene.feed()
    after = scene.ask(0.5).twist.linear
    assert after - before == pytest.approx(0.05)


@pytest.mark.parametrize(("late_ns", "command"), [(0, "run"), (1, "stop")])
def test_what_waited_for_a_stalled_process_is_not_taken_for_fresh(
    late_ns: int, command: str
) -> None:
    scene = Scene().running()
    scene.now_ns += round(Safety().bumper_age * NS_PER_S) + late_ns
    scene.feed()
    scene.state = replace(scene.state, heartbeat=scene.state.heartbeat.beat(scene.now_ns))
    assert scene.ask(0.5).command == command
    if late_ns:
        assert "held up" in scene.state.latches["silent"].text
        assert scene.drive(0.5, seconds=2.0).command == "stop"
        scene.drive()
    assert scene.drive(0.5).command == "run"


def test_what_is_held_knows_since_when() -> None:
    scene = Scene().ready()
    lease_ticks = round(0.3 / TICK_S)
    scene.tick(lease_ticks)
    assert "no_request" not in scene.state.latches
    scene.tick()
    since_ns = scene.now_ns
    scene.tick(3)
    now_ns = scene.now_ns
    held = scene.state.latches["no_request"]
    assert held == Held(since_ns, now_ns, 0, (0, now_ns), "Nobody asks to move.", held.id)


def test_flapping_knows_since_when() -> None:
    scene = Scene().ready()
    for _ in range(int(FAILURES)):
        scene.tick(40)
        scene.muted = {"bumper"}
        scene.tick(9)
        scene.muted = set()
    held = scene.state.latches["flapping"]
    assert scene.now_ns - NS_PER_S // 10 < held.since_ns < held.bad_ns == scene.now_ns
    assert held.token == (0, scene.now_ns)


def test_a_cause_is_identified_by_the_decision_in_which_it_began() -> None:
    scene = Scene().ready()
    for _ in range(int(FAILURES)):
        scene.tick(40)
        scene.muted = {"bumper"}
        for _ in range(9):
            scene.tick()
            if "flapping" in scene.state.latches:
                break
        else:
            scene.muted = set()
    for name in ("flapping", "no_request"):
        assert scene.state.latches[name].id // len(RULES) > 0
    assert scene.state.latches["flapping"].id // len(RULES) == scene.state.decision


def test_room_is_not_looked_for_while_motion_is_barred() -> None:
    scene = Scene().running()
    scene.estop()
    scene.linear = 0.0
    scene.sonar(front=0.1)
    assert scene.drive(0.5).command == "brake"
    assert "blocked" not in scene.state.latches
    assert scene.verdict.twist == STILL


def test_a_wish_that_is_not_followed_is_not_told_as_a_motion() -> None:
    scene = Scene()
    scene.tick(40)
    scene.drive(0.5)
    assert scene.tick().name == "inhibited"  # time has passed, so that a ramp would have begun
    assert "neutral" in scene.state.latches
    assert scene.verdict.twist == STILL


def test_nothing_creeps_while_two_publishers_ask() -> None:
    scene = hit()
    scene.ask(0.0)
    assert scene.hold() == ""
    assert "release" in scene.state.latches
    scene.driver_boot, scene.driver_seq = 100, 0
    assert scene.ask(0.0).refused == "second_publisher"
    assert scene.verdict.command == "brake"  # the release ends, and the bumper is still pressed
    assert "release" not in scene.state.latches
