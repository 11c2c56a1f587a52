"""The verdict, cause by cause: what trips it, at which boundary, and how it clears."""

import math
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Drive, Limits, SafetyState, Switches
from services.safety.config import Safety
from services.safety.core.causes import BY_NAME, FAILURES, Clears, latched
from services.safety.core.inputs import DriveRequest
from tests.safety.policy_fixture import TICK_S, PolicyFixture, link


def test_a_start_waits_for_every_input() -> None:
    fixture = PolicyFixture()
    assert fixture.decide().name == "inhibited"
    assert fixture.state.latches["starting"].text.count(",") == 6
    fixture.estop_connection = 0
    fixture.decide()
    assert "emergency stop" in fixture.state.latches["starting"].text


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


def test_a_neutral_request_while_inputs_settle_does_not_count() -> None:
    fixture = PolicyFixture()
    fixture.drive(seconds=0.1)
    assert fixture.tick(40).name == "stop"  # the lease is over by now
    assert fixture.drive(0.5).name == "inhibited"


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
    assert fixture.reset() == "Motion is requested: release the controls first."
    fixture.tick(40)
    assert fixture.reset() == ""
    assert not latched(fixture.state.latches)
    assert fixture.drive(0.5, seconds=1.0).name == "inhibited"
    assert fixture.drive().command == "run"


@pytest.mark.parametrize(("cause", "command", "trip", "cure"), LATCHING)
def test_a_reset_is_refused_while_the_cause_is_there(
    cause: str, command: str, trip: Trip, cure: Trip
) -> None:
    fixture = PolicyFixture().running()
    trip(fixture)
    fixture.tick(30)
    assert fixture.state.latches[cause].good >= 3 or "Still present" in fixture.reset()
    assert fixture.verdict.command == command


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


def test_velocities_that_fall_silent_stop_the_vehicle_and_need_no_reset() -> None:
    fixture = PolicyFixture().running()
    fixture.muted = {"velocity"}
    assert fixture.drive(0.5, seconds=0.2).command == "run"
    assert fixture.drive(0.5, seconds=0.02).name == "inhibited"
    assert fixture.state.latches["silent"].text == "No recent data: velocity."
    fixture.muted = set()
    assert fixture.drive(0.5, seconds=1.0).name == "inhibited"
    assert fixture.drive().command == "run"


def test_inputs_that_fail_again_and_again_latch() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(int(FAILURES)):
        fixture.muted = {"bumper"}
        fixture.tick(10)
        fixture.muted = set()
        fixture.tick(40)
    assert latched(fixture.state.latches) == ("flapping",)
    assert fixture.drive().command == "stop"
    fixture.tick(20)
    assert fixture.reset() == ""
    assert fixture.drive(seconds=1.0).command == "run"


def test_inputs_that_fail_now_and_then_are_forgiven() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(int(FAILURES) + 2):
        fixture.muted = {"bumper"}
        fixture.tick(10)
        fixture.muted = set()
        fixture.tick(600)
    assert not latched(fixture.state.latches)


SETTLING: list[tuple[str, Trip, Trip]] = [
    ("link", _set("link", link("lost")), _set("link", link())),
    ("link", _set("link", link("never")), _set("link", link())),
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
    ("silent", _set("linear", math.nan), _set("linear", 0.0)),
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
    fixture.link = link("lost")
    fixture.tick()
    fixture.link = link()
    fixture.tick(round(0.5 / TICK_S) - 1)
    assert "link" in fixture.state.latches
    fixture.tick()
    assert "link" not in fixture.state.latches


@pytest.mark.parametrize(
    ("stream", "limit_s", "cause"),
    [
        ("bumper", 0.15, "bumper"),
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
    assert fixture.state.latches["bumper"].text == "Samples of the bumper were lost."


def test_a_bridge_that_started_anew_wants_a_neutral_request() -> None:
    fixture = PolicyFixture().running()
    fixture.boot, fixture.seq = 8, 0
    fixture.drive(0.5, seconds=1.0)
    assert fixture.verdict.name == "inhibited"
    assert fixture.drive().command == "run"


def test_what_was_judged_is_the_newest_bumper_sample() -> None:
    fixture = PolicyFixture().ready()
    fixture.tick()
    assert fixture.verdict.acked == (fixture.boot, fixture.seq)


def test_leaving_stops() -> None:
    fixture = PolicyFixture().running()
    fixture.inputs = replace(fixture.inputs, leaving=True)
    assert fixture.decide().command == "stop"
    assert fixture.drive(0.5).command == "stop"


def test_the_switches_may_be_accepted_as_missing() -> None:
    settings = Safety(require_switches=False, unsafe_overrides=("require_switches",))
    fixture = PolicyFixture(settings)
    fixture.switches = Switches()
    assert fixture.ready().verdict.command == "run"


def test_every_cause_of_the_table_can_be_reported() -> None:
    for rule in BY_NAME.values():
        assert rule.text.endswith(".")
        assert rule.action != "slow" or rule.clears is Clears.AT_ONCE


def test_an_emergency_stop_that_only_the_bridge_received_latches_and_is_acknowledged() -> None:
    fixture = PolicyFixture().running(0.3)
    fixture.link = replace(fixture.link, estop=77)
    assert fixture.tick().command == "brake"
    assert latched(fixture.state.latches) == ("estop",)
    assert fixture.motions[-1].estop == 77
    fixture.linear = 0.0
    fixture.tick(60)
    assert fixture.reset() == ""  # also before the bridge has received the acknowledgement
    fixture.tick()
    assert fixture.motions[-1].estop == 77
    fixture.link = replace(fixture.link, estop=78)
    assert fixture.tick().command == "brake"


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


def test_two_publishers_of_a_source_that_is_not_in_control_stop_nothing() -> None:
    fixture = PolicyFixture().running(0.3)
    for boot in (1, 2, 1, 2):
        drive = Drive(linear=0.0, angular=0.0, echo=fixture.echo, seq=boot, boot=boot)
        fixture.decide(DriveRequest("nav", drive, fixture.now_ns))
        assert fixture.drive(0.3, seconds=0.1).command == "run"
    assert fixture.drive(0.3).source == "teleop"


def test_a_router_that_passes_nothing_on_stops_the_vehicle_until_a_neutral_request() -> None:
    fixture = PolicyFixture().running(0.3)
    state = SafetyState(
        verdict="run", latched=(), causes=(), source=None, heartbeat=1, text="",
        limits=Limits(forward=1.0, backward=1.0, angular=1.0),
    )  # fmt: skip
    fixture.inputs = replace(fixture.inputs, estop_path=Latest(state, fixture.now_ns))
    assert fixture.drive(0.3, seconds=0.18).command == "run"
    assert fixture.drive(0.3, seconds=0.08).command == "stop"
    assert "the emergency stop's path through the router" in fixture.state.latches["silent"].text
    fixture.inputs = replace(
        fixture.inputs, estop_path=Latest(state, fixture.now_ns + 2 * NS_PER_S)
    )
    assert fixture.drive(0.3, seconds=1.0).command == "stop"
    fixture.drive()
    assert fixture.drive(0.3).command == "run"
