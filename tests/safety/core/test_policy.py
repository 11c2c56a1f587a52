"""The verdict, cause by cause: what trips it, at which boundary, and how it clears."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.settings import Host
from services.safety.config import SafetyConfig
from services.safety.core.causes import FAILURES, RULES, FaultBudget, Held, latched
from services.safety.core.inputs import DriveRequest, Inputs
from t2.messages import (
    Bumper,
    Drive,
    Phrase,
    Switches,
    Velocity,
)
from t2.words import render
from tests.factories import link
from tests.safety.core.policy_fixture import DIRECTIONS, TICK_S, UNKNOWN_TEXT, PolicyFixture, hit


@pytest.mark.parametrize(
    "missing", ["velocity", "ultrasonic", "bumper", "left", "right", "switches", "link"]
)
def test_one_missing_input_inhibits_for_ever(missing: str) -> None:
    fixture = PolicyFixture()
    fixture.muted = {missing}
    for _ in range(5):
        assert fixture.drive().name == "inhibited"
        assert fixture.drive(0.5).command == "stop"


def test_a_neutral_request_comes_before_the_first_run() -> None:
    fixture = PolicyFixture()
    fixture.tick(40)
    assert fixture.drive(0.5, seconds=1.0).name == "inhibited"
    assert "neutral" in fixture.state.latches
    assert fixture.drive().command == "run"
    assert fixture.drive(0.5).twist.linear > 0


Trip = Callable[[PolicyFixture], None]


def _set(name: str, value: object) -> Trip:
    return lambda fixture: setattr(fixture, name, value)


LATCHING: list[tuple[str, str, Trip, Trip]] = [
    ("contact", "brake", _set("pressed", True), _set("pressed", False)),
    ("estop", "brake", lambda fixture: (fixture.estop(), None)[1], lambda fixture: None),
    ("estop_reader", "brake", _set("estop_connection", 0), _set("estop_connection", 1)),
    ("driver_left", "stop", _set("left_bits", 1), _set("left_bits", 0)),
    ("driver_right", "stop", _set("right_bits", 1 << 31), _set("right_bits", 0)),
    ("runaway", "brake", _set("linear", 0.9), _set("linear", None)),
]


@pytest.mark.parametrize(("cause", "command", "trip", "cure"), LATCHING)
def test_a_latched_trip_holds_until_a_reset_and_a_neutral_request(
    cause: str, command: str, trip: Trip, cure: Trip
) -> None:
    fixture = PolicyFixture().running()
    trip(fixture)
    fixture.drive(0.5, seconds=0.4)
    assert fixture.verdict.command == command
    assert cause in latched(fixture.state.latches)
    cure(fixture)
    fixture.linear = 0.0
    fixture.drive(0.5, seconds=2.0)
    assert fixture.verdict.command == command
    assert fixture.reset() == "A command to drive is given: let go of the controls first."
    fixture.tick(40)
    assert fixture.reset() == ""
    assert not latched(fixture.state.latches)
    assert fixture.drive(0.5, seconds=1.0).name == "inhibited"
    assert fixture.drive().command == "run"


def test_one_hit_sample_is_enough_and_three_clear_ones_are_needed() -> None:
    fixture = PolicyFixture().running()
    fixture.linear = 0.0
    fixture.pressed = True
    assert fixture.tick().command == "brake"
    fixture.pressed = False
    fixture.tick(20)
    fixture.pressed = True
    fixture.tick()
    fixture.pressed = False
    for _ in range(2):
        fixture.tick()
        assert "Still present" in fixture.reset()
    fixture.decide()  # looking again at the same sample proves nothing
    assert "Still present" in fixture.reset()
    fixture.tick(20)
    assert fixture.reset() == ""


def test_inputs_that_fail_again_and_again_latch() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(int(FAILURES)):
        assert "flapping" not in fixture.state.latches
        fixture.tick(40)
        fixture.muted = {"bumper"}
        while "bumper" not in fixture.state.latches:
            fixture.tick()
        fixture.muted = set()
    held, now_ns = fixture.state.latches["flapping"], fixture.now_ns
    assert held == Held(now_ns, now_ns, 0, (0, now_ns), (Phrase("flapping"),), held.id)
    assert held.id // len(RULES) == fixture.state.decision
    fixture.tick(40)
    assert latched(fixture.state.latches) == ("flapping",)
    assert fixture.drive().command == "stop"
    fixture.tick(20)
    fixture.estop()
    fixture.tick(5)
    assert fixture.reset(fixture.state.latches["estop"].id) == ""
    assert fixture.state.fault_budget.remaining < FAILURES
    assert fixture.reset() == ""
    assert fixture.state.fault_budget == FaultBudget()
    assert fixture.drive(seconds=1.0).command == "run"


SETTLING: list[tuple[str, Trip, Trip]] = [
    ("link", _set("link", link(state="lost")), _set("link", link())),
    ("link", _set("link", link(state="never")), _set("link", link())),
    ("unarmed", _set("link", link(armed=False)), _set("link", link())),
    (
        "switches",
        _set("switches", Switches(ultrasonic_brake=True, bumper_brake=None)),
        _set("switches", Switches(ultrasonic_brake=True, bumper_brake=True)),
    ),
    (
        "switches",
        _set("switches", Switches(ultrasonic_brake=False, bumper_brake=True)),
        _set("switches", Switches(ultrasonic_brake=True, bumper_brake=True)),
    ),
    ("bumper", _set("muted", {"bumper"}), _set("muted", set())),
    ("silent", _set("muted", {"velocity"}), _set("muted", set())),
    ("silent", _set("muted", {"link"}), _set("muted", set())),
    ("silent", _set("muted", {"switches"}), _set("muted", set())),
    ("silent", _set("muted", {"left"}), _set("muted", set())),
    ("silent", _set("muted", {"right"}), _set("muted", set())),
]


@pytest.mark.parametrize(("cause", "trip", "cure"), SETTLING)
def test_a_lost_input_inhibits_until_it_settled_and_a_neutral_request(
    cause: str, trip: Trip, cure: Trip
) -> None:
    fixture = PolicyFixture().ready()
    trip(fixture)
    fixture.drive(seconds=3.2)
    assert fixture.verdict.name == "inhibited"
    assert cause in fixture.state.latches
    cure(fixture)
    fixture.drive(0.5, seconds=2.0)
    assert fixture.verdict.name == "inhibited"
    assert cause not in fixture.state.latches
    fixture.drive()
    assert fixture.verdict.command == "run"


def test_settling_takes_half_a_second_of_good_inputs() -> None:
    fixture = PolicyFixture().ready()
    fixture.link = link(state="lost")
    fixture.tick()
    fixture.link = link()
    fixture.tick(round(0.5 / TICK_S) - 1)
    assert "link" in fixture.state.latches
    fixture.tick()
    assert "link" not in fixture.state.latches


@pytest.mark.parametrize(
    ("stream", "limit_s", "cause"),
    [
        ("bumper", 0.07, "bumper"),
        ("velocity", 0.2, "silent"),
        ("link", 0.6, "silent"),
        ("left", 2.0, "silent"),
        ("switches", 3.0, "silent"),
    ],
)
def test_an_input_is_too_old_one_nanosecond_after_its_age(
    stream: str, limit_s: float, cause: str
) -> None:
    fixture = PolicyFixture().ready()
    fixture.muted = {stream}
    due_ns = fixture.now_ns + round(limit_s * NS_PER_S)
    fixture.tick(round(limit_s / TICK_S) - 1)
    fixture.now_ns = due_ns
    fixture.feed()
    fixture.decide()
    assert cause not in fixture.state.latches
    fixture.now_ns += 1
    fixture.decide()
    assert cause in fixture.state.latches


def test_lost_bumper_samples_could_hide_a_hit() -> None:
    fixture = PolicyFixture().ready()
    fixture.seq += 2
    fixture.tick()
    assert "bumper" not in fixture.state.latches
    fixture.seq += 3
    fixture.tick()
    assert render(fixture.state.latches["bumper"].phrases) == "Samples of the bumper were lost."


def test_a_bridge_that_started_anew_wants_a_neutral_request() -> None:
    fixture = PolicyFixture().running()
    fixture.boot, fixture.seq = 8, 0
    fixture.drive(0.5, seconds=1.0)
    assert fixture.verdict.name == "inhibited"
    assert fixture.drive().command == "run"


def test_an_emergency_stop_that_only_the_bridge_received_latches_and_is_acknowledged() -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.link = replace(fixture.link, estop=77)
    assert fixture.tick().command == "brake"
    assert latched(fixture.state.latches) == ("estop",)
    assert fixture.motion.estop == 77
    fixture.linear = 0.0
    fixture.tick(60)
    assert fixture.reset() == ""  # also before the bridge has received the acknowledgement
    fixture.tick()
    assert fixture.motion.estop == 77
    fixture.link = replace(fixture.link, estop=78)
    assert fixture.tick().command == "brake"
    fixture.pressed = True
    fixture.tick()
    assert fixture.motion.estop == 78


def test_a_connection_that_was_lost_between_two_decisions_latches() -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.estop_connection += 1
    assert fixture.tick().command == "brake"
    assert latched(fixture.state.latches) == ("estop_reader",)
    fixture.linear = 0.0
    fixture.tick(60)
    assert fixture.reset() == ""


@pytest.mark.parametrize(("stall_s", "names"), [(1.0, ()), (1.01, ("estop_reader",))])
def test_a_stall_in_which_an_emergency_stop_may_be_missed_latches(
    stall_s: float, names: tuple[str, ...]
) -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.now_ns += round((stall_s - TICK_S) * NS_PER_S)
    fixture.tick()
    assert latched(fixture.state.latches) == names


def test_a_router_that_passes_nothing_on_stops_the_vehicle_until_a_neutral_request() -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.muted = {"estop_path"}
    assert fixture.drive(0.3, seconds=0.18).command == "run"
    assert fixture.drive(0.3, seconds=0.08).command == "stop"
    assert "the path of the emergency stop" in render(fixture.state.latches["silent"].phrases)
    fixture.muted = set()
    assert fixture.drive(0.3, seconds=1.0).command == "stop"
    fixture.drive()
    assert fixture.drive(0.3).command == "run"


@pytest.mark.no_cover
def test_nothing_drives_before_the_emergency_stop_s_path_was_proven() -> None:
    fixture = PolicyFixture()
    fixture.muted = {"estop_path"}
    fixture.tick(40)
    fixture.drive()
    assert fixture.drive(0.3, seconds=60.0).command == "stop"
    path = "the path of the emergency stop"
    assert fixture.text("starting") == f"Waiting for the first sample of: {path}."
    fixture.muted = set()
    assert fixture.drive(0.3, seconds=1.0).command == "stop"
    fixture.drive()
    assert fixture.drive(0.3).command == "run"


def test_an_old_velocity_is_no_runaway() -> None:
    fixture = PolicyFixture().ready()
    fixture.linear = 0.9
    fixture.tick()
    fixture.muted = {"velocity"}
    fixture.tick(40)
    assert "silent" in fixture.state.latches
    assert "runaway" not in fixture.state.latches


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


def test_the_first_bumper_sample_follows_none() -> None:
    """Numbers start anywhere: only between two samples can one be lost."""
    fixture = PolicyFixture()
    fixture.seq = 1000
    fixture.tick()
    assert "bumper" not in fixture.state.latches


def test_a_pause_of_the_process_does_not_leap_the_ramp() -> None:
    """It may pause for so long only where its host is known to."""
    fixture = PolicyFixture(
        SafetyConfig(host=Host(stall=0.1), unsafe_overrides=("host.stall",))
    ).ready()
    before = fixture.drive(0.5).twist.linear
    fixture.now_ns += NS_PER_S // 8
    fixture.feed()
    after = fixture.request(0.5).twist.linear
    assert after - before == pytest.approx(0.05)


@pytest.mark.parametrize(("late_ns", "command"), [(0, "run"), (1, "stop")])
def test_samples_queued_during_a_stall_are_not_fresh(late_ns: int, command: str) -> None:
    fixture = PolicyFixture().running()
    fixture.now_ns += round(SafetyConfig().times.bumper_age * NS_PER_S) + late_ns
    fixture.feed()
    fixture.state = replace(fixture.state, heartbeat=fixture.state.heartbeat.beat(fixture.now_ns))
    assert fixture.request(0.5).command == command
    if late_ns:
        assert "stalled" in render(fixture.state.latches["silent"].phrases)
        assert fixture.drive(0.5, seconds=2.0).command == "stop"
        fixture.drive()
    assert fixture.drive(0.5).command == "run"


@pytest.mark.parametrize("latched_by", [None, 41])
def test_the_motion_of_a_new_contact_acknowledges_it(latched_by: int | None) -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.link = replace(link(), latched_by=latched_by)
    fixture.pressed = True
    fixture.tick()
    motion = fixture.motion
    assert (motion.command, motion.judged, motion.latched) == ("brake", fixture.seq, True)
    assert motion.predecessor == latched_by


@pytest.mark.parametrize(("source", "ticks"), [("nav", 12), ("teleop", 16)])
def test_a_source_that_was_silent_at_a_standstill_does_not_drive_on(
    source: str, ticks: int
) -> None:
    fixture = PolicyFixture().ready()
    fixture.tick(20)
    fixture.drive(source=source)
    fixture.drive(0.5, seconds=1.0, source=source)
    fixture.tick(ticks - 4)
    fixture.request(0.5, source=source)
    assert fixture.verdict.command == "run"  # its lease lives
    fixture.tick(ticks + 40)  # it stops, and stands
    assert fixture.verdict.twist.is_zero
    fixture.drive(0.5, seconds=1.0, source=source)
    assert fixture.verdict.command == "stop"
    assert "neutral" in fixture.state.latches
    fixture.drive(source=source)
    assert fixture.drive(0.5, source=source).command == "run"


def test_a_rest_is_remembered_while_the_vehicle_moves_again() -> None:
    fixture = PolicyFixture().running(0.5)
    fixture.linear = 0.0
    fixture.tick(20)  # its lease is over, and it stands
    fixture.linear = 0.1
    fixture.tick(3)
    fixture.drive(0.5, seconds=0.1)
    assert "neutral" in fixture.state.latches


def test_a_gap_in_which_the_vehicle_never_stood_changes_nothing() -> None:
    fixture = PolicyFixture().running(0.5)
    fixture.linear = 0.3  # it rolls on
    fixture.tick(30)
    assert fixture.verdict.command == "stop"
    assert fixture.drive(0.5).command == "run"


def test_a_zero_that_arrives_under_a_higher_source_is_not_neutral() -> None:
    """Between two decisions the higher source falls silent."""
    fixture = PolicyFixture().ready()
    fixture.tick(15)
    zero = Drive(linear=0.0, angular=0.0, echo=fixture.echo, seq=1, boot=3)
    request = DriveRequest("nav", zero, fixture.now_ns)
    state, _ = fixture.policy.accept(fixture.state, request, fixture.now_ns)
    assert not state.arbiter.is_neutral("nav")


def test_a_clear_sample_counts_once_however_often_it_is_decided_on() -> None:
    fixture = hit()
    fixture.pressed = False
    fixture.tick()
    for _ in range(5):
        fixture.now_ns += NS_PER_S // 200
        fixture.decide()
    assert fixture.state.latches["contact"].good == 1


def test_a_contact_brakes_before_any_other_sample() -> None:
    fixture = PolicyFixture()
    fixture.inputs = Inputs(bumper=Latest(Bumper(pressed=True), 5))
    fixture.decide()
    assert (fixture.motion.command, fixture.motion.predecessor) == ("brake", None)


def test_a_velocity_is_unknown_until_its_first_sample() -> None:
    assert Inputs().measured is None
    velocity = Latest(Velocity(linear=0.5, angular=0.1), 7)
    assert Inputs(velocity=velocity).measured == Latest(Twist(0.5, 0.1), 7)


OLD, OWN = 5, 6


def successor(latched_by: int | None) -> PolicyFixture:
    """Start a service beside a bridge that remembers this."""
    fixture = PolicyFixture()
    fixture.inputs = replace(fixture.inputs, boot=OWN)
    fixture.link = replace(fixture.link, latched_by=latched_by)
    return fixture


def test_a_latch_is_reported_until_it_is_reset() -> None:
    fixture, told = PolicyFixture().running(), []
    for step in (fixture.tick, fixture.estop, lambda: fixture.drive(0.0, seconds=1.0)):
        step()
        told.append(fixture.motion.latched)
    assert fixture.reset() == ""
    assert [*told, fixture.motion.latched] == [False, True, True, False]


def test_a_successor_takes_the_latch_on_and_only_a_reset_clears_it() -> None:
    fixture = successor(latched_by=OLD)
    fixture.tick(100)
    fixture.drive(0.0)
    assert fixture.drive(0.5, seconds=1.0).command == "brake"
    assert latched(fixture.state.latches) == ("predecessor",)
    motion = fixture.motion
    assert (motion.latched, motion.predecessor) == (True, OLD)
    assert fixture.reset() == "Still present: Safety restarted while a reset was due."
    fixture.link = replace(fixture.link, latched_by=OWN)  # the bridge has received our latch
    fixture.tick(100)
    assert fixture.reset() == ""
    fixture.link = replace(fixture.link, latched_by=None)
    fixture.drive(0.0)
    assert fixture.drive(0.5).command == "run"


@pytest.mark.parametrize("first", ["bumper", "link"])
def test_a_successor_gives_no_release_for_a_contact_beside_the_latch(first: str) -> None:
    fixture = successor(latched_by=OLD)
    fixture.pressed = True
    fixture.muted = {"link" if first == "bumper" else "bumper"}
    fixture.tick(3)
    fixture.muted = set()
    fixture.tick(50)
    assert latched(fixture.state.latches) == ("contact", "predecessor")
    fixture.link = replace(fixture.link, latched_by=OWN)
    fixture.tick(10)
    assert fixture.reset() == ""
    assert (
        fixture.answer()
        == f"Reset, but these need another reset: The bumper was hit. {UNKNOWN_TEXT}"
    )
    for direction in DIRECTIONS:
        fixture.let_go()
        assert fixture.hold(direction) == UNKNOWN_TEXT
    fixture.let_go()
    release = fixture.release()
    assert release.left == 0.0
    assert fixture.reset() == f"Still present: The bumper was hit. {UNKNOWN_TEXT}"


def test_a_motion_carries_its_verdict() -> None:
    fixture = PolicyFixture().running(0.3, 0.1)
    fixture.tick()
    motion = fixture.motion
    assert (motion.command, motion.linear, motion.angular) == ("run", 0.3, 0.1)
    assert (motion.judged_boot, motion.judged) == (fixture.boot, fixture.seq)
    assert (motion.source, motion.latched) == ("teleop", False)
    assert fixture.verdict.control == "teleop"


def test_a_stop_carries_no_velocity_and_a_barred_source_is_not_in_control() -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.sonar(front=0.1)
    fixture.drive(0.3)
    motion = fixture.motion
    assert (motion.command, motion.linear, motion.source) == ("stop", 0.0, "teleop")
    assert fixture.verdict.control == "teleop"
    fixture.link = replace(fixture.link, state="lost")
    barred = fixture.drive(0.3)
    assert (barred.name, barred.source, barred.control) == ("inhibited", "teleop", None)


def test_each_occurrence_of_a_cause_of_the_plan_has_its_own_identity() -> None:
    fixture, found = PolicyFixture().ready(), []
    for _ in range(2):
        fixture.drive(0.3)
        fixture.sonar(front=0.1)
        fixture.drive(0.3)
        found.append(fixture.state.latches["blocked"].id)
        fixture.sonar(front=5.0)
        fixture.drive()
    assert found[0] != found[1]
