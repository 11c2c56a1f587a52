"""The verdict, cause by cause: what trips it, at which boundary, and how it clears."""

import math
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Limits, SafetyState, Switches
from services.safety.causes import BY_NAME, Clears
from services.safety.config import Safety
from services.safety.fault_budget import FAILURES
from services.safety.latches import latched
from tests.safety.policy_fixture import TICK_S, Scene, link


def test_a_start_waits_for_every_input() -> None:
    scene = Scene()
    assert scene.decide().name == "inhibited"
    assert scene.state.latches["starting"].text.count(",") == 6
    scene.reader = False
    scene.decide()
    assert "emergency stop" in scene.state.latches["starting"].text


@pytest.mark.parametrize(
    "missing", ["velocity", "ultrasonic", "bumper", "left", "right", "switches", "link"]
)
def test_one_missing_input_inhibits_for_ever(missing: str) -> None:
    scene = Scene()
    scene.muted = {missing}
    for _ in range(5):
        assert scene.drive().name == "inhibited"
        assert scene.drive(0.5).command == "stop"


def test_a_neutral_request_comes_before_the_first_run() -> None:
    scene = Scene()
    scene.tick(40)
    assert scene.drive(0.5, seconds=1.0).name == "inhibited"
    assert "neutral" in scene.state.latches
    assert scene.drive().command == "run"
    assert scene.drive(0.5).twist.linear > 0


def test_a_neutral_request_while_inputs_settle_does_not_count() -> None:
    scene = Scene()
    scene.drive(seconds=0.1)
    assert scene.tick(40).name == "stop"  # the lease is over by now
    assert scene.drive(0.5).name == "inhibited"


Trip = Callable[[Scene], None]


def _set(name: str, value: object) -> Trip:
    return lambda scene: setattr(scene, name, value)


LATCHING: list[tuple[str, str, Trip, Trip]] = [
    ("contact", "brake", _set("pressed", True), _set("pressed", False)),
    ("estop", "brake", lambda scene: (scene.estop(), None)[1], lambda scene: None),
    ("estop_reader", "brake", _set("reader", False), _set("reader", True)),
    ("driver_left", "stop", _set("left_bits", 1), _set("left_bits", 0)),
    ("driver_right", "stop", _set("right_bits", 1 << 31), _set("right_bits", 0)),
    ("runaway", "brake", _set("linear", 0.9), _set("linear", None)),
]


@pytest.mark.parametrize(("cause", "command", "trip", "cure"), LATCHING)
def test_a_latched_trip_holds_until_a_reset_and_a_neutral_request(
    cause: str, command: str, trip: Trip, cure: Trip
) -> None:
    scene = Scene().running()
    trip(scene)
    scene.drive(0.5, seconds=0.4)
    assert scene.verdict.command == command
    assert cause in latched(scene.state.latches)
    cure(scene)
    scene.linear = 0.0
    scene.drive(0.5, seconds=2.0)
    assert scene.verdict.command == command
    assert scene.reset() == "Motion is requested: release the controls first."
    scene.tick(40)
    assert scene.reset() == ""
    assert not latched(scene.state.latches)
    assert scene.drive(0.5, seconds=1.0).name == "inhibited"
    assert scene.drive().command == "run"


@pytest.mark.parametrize(("cause", "command", "trip", "cure"), LATCHING)
def test_a_reset_is_refused_while_the_cause_is_there(
    cause: str, command: str, trip: Trip, cure: Trip
) -> None:
    scene = Scene().running()
    trip(scene)
    scene.tick(30)
    assert scene.state.latches[cause].good >= 3 or "Not gone yet" in scene.reset()
    assert scene.verdict.command == command


def test_one_hit_sample_is_enough_and_three_clear_ones_are_needed() -> None:
    scene = Scene().running()
    scene.linear = 0.0
    scene.pressed = True
    assert scene.tick().command == "brake"
    scene.pressed = False
    scene.tick(20)
    scene.pressed = True
    scene.tick()
    scene.pressed = False
    for _ in range(2):
        scene.tick()
        assert "Not gone yet" in scene.reset()
    scene.decide()  # looking again at the same sample proves nothing
    assert "Not gone yet" in scene.reset()
    scene.tick(20)
    assert scene.reset() == ""


def test_velocities_that_fall_silent_stop_the_vehicle_and_need_no_reset() -> None:
    scene = Scene().running()
    scene.muted = {"velocity"}
    assert scene.drive(0.5, seconds=0.2).command == "run"
    assert scene.drive(0.5, seconds=0.02).name == "inhibited"
    assert scene.state.latches["silent"].text == "Not heard lately: velocity."
    scene.muted = set()
    assert scene.drive(0.5, seconds=1.0).name == "inhibited"
    assert scene.drive().command == "run"


def test_inputs_that_fail_again_and_again_latch() -> None:
    scene = Scene().ready()
    for _ in range(int(FAILURES)):
        scene.muted = {"bumper"}
        scene.tick(10)
        scene.muted = set()
        scene.tick(40)
    assert latched(scene.state.latches) == ("flapping",)
    assert scene.drive().command == "stop"
    scene.tick(20)
    assert scene.reset() == ""
    assert scene.drive(seconds=1.0).command == "run"


def test_inputs_that_fail_now_and_then_are_forgiven() -> None:
    scene = Scene().ready()
    for _ in range(int(FAILURES) + 2):
        scene.muted = {"bumper"}
        scene.tick(10)
        scene.muted = set()
        scene.tick(600)
    assert not latched(scene.state.latches)


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
    scene = Scene().ready()
    trip(scene)
    scene.drive(seconds=3.2)
    assert scene.verdict.name == "inhibited"
    assert cause in scene.state.latches
    cure(scene)
    scene.drive(0.5, seconds=2.0)
    assert scene.verdict.name == "inhibited"
    assert cause not in scene.state.latches
    scene.drive()
    assert scene.verdict.command == "run"


def test_settling_takes_half_a_second_of_good_inputs() -> None:
    scene = Scene().ready()
    scene.link = link("lost")
    scene.tick()
    scene.link = link()
    scene.tick(round(0.5 / TICK_S) - 1)
    assert "link" in scene.state.latches
    scene.tick()
    assert "link" not in scene.state.latches


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
    scene = Scene().ready()
    scene.muted = {stream}
    due_ns = scene.now_ns + round(limit_s * NS_PER_S)
    scene.tick(round(limit_s / TICK_S) - 1)
    scene.now_ns = due_ns
    scene.feed()
    scene.decide()
    assert cause not in scene.state.latches
    scene.now_ns += 1
    scene.decide()
    assert cause in scene.state.latches


def test_lost_bumper_samples_could_hide_a_hit() -> None:
    scene = Scene().ready()
    scene.seq += 2
    scene.tick()
    assert "bumper" not in scene.state.latches
    scene.seq += 3
    scene.tick()
    assert scene.state.latches["bumper"].text == "Samples of the bumper were lost."


def test_a_bridge_that_started_anew_wants_a_neutral_request() -> None:
    scene = Scene().running()
    scene.boot, scene.seq = 8, 0
    scene.drive(0.5, seconds=1.0)
    assert scene.verdict.name == "inhibited"
    assert scene.drive().command == "run"


def test_what_was_judged_is_the_newest_bumper_sample() -> None:
    scene = Scene().ready()
    scene.tick()
    assert scene.verdict.judged == (scene.boot, scene.seq)


def test_leaving_stops() -> None:
    scene = Scene().running()
    scene.inputs = replace(scene.inputs, leaving=True)
    assert scene.decide().command == "stop"
    assert scene.drive(0.5).command == "stop"


def test_the_switches_may_be_accepted_as_missing() -> None:
    settings = Safety(require_switches=False, unsafe_overrides=("require_switches",))
    scene = Scene(settings)
    scene.switches = Switches()
    assert scene.ready().verdict.command == "run"


def test_every_cause_of_the_table_can_be_told() -> None:
    for rule in BY_NAME.values():
        assert rule.text.endswith(".")
        assert rule.action != "slow" or rule.clears is Clears.AT_ONCE


def test_a_router_that_passes_nothing_on_stops_the_vehicle_until_a_neutral_request() -> None:
    scene = Scene().running(0.3)
    state = SafetyState(
        verdict="run", latched=(), causes=(), source=None, heartbeat=1, text="",
        limits=Limits(forward=1.0, backward=1.0, angular=1.0),
    )  # fmt: skip
    scene.inputs = replace(scene.inputs, estop_path=Latest(state, scene.now_ns))
    assert scene.drive(0.3, seconds=0.18).command == "run"
    assert scene.drive(0.3, seconds=0.08).command == "stop"
    assert "the emergency stop passes" in scene.state.latches["silent"].text
    scene.inputs = replace(scene.inputs, estop_path=Latest(state, scene.now_ns + 2 * NS_PER_S))
    assert scene.drive(0.3, seconds=1.0).command == "stop"
    scene.drive()
    assert scene.drive(0.3).command == "run"
