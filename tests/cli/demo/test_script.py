"""The lap step by step: what each asks for, when it is over, and what a stop does to it."""

import math

import pytest
from msgspec.structs import astuple

from cli.demo.script import PATIENT, QUICK, Ask, Lap, Step, View, lap, still, wrap
from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from tests.cli.demo.lap_fixture import odometry, safety, view

STEPS = lap(fast=False)
START = odometry()
NAMES = [
    "wait for safety", "drive off to the wall", "back off", "turn left", "drive on",
    "reset, refused", "release", "reset", "back off",
    "turn home", "drive home", "turn as at the start",
]  # fmt: skip
WAIT, OFF, BACK, LEFT, ON, REFUSED, RELEASE, RESET, CLEAR, TURN_HOME, HOME, AS_AT_START = STEPS


def test_the_steps_and_what_the_fast_lap_leaves_out() -> None:
    assert [step.name for step in STEPS] == NAMES
    assert [step.name for step in lap(fast=True)] == NAMES[:9]


# --- what each step asks for ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "pose", "twist"),
    [
        (WAIT, {}, STILL),
        (OFF, {}, Twist(0.8, 0.0)),
        (OFF, {"heading": 0.1}, Twist(0.8, -0.2)),
        (OFF, {"heading": -1.0}, Twist(0.8, 0.3)),  # as much as it steers
        (BACK, {}, Twist(-0.4, 0.0)),
        (LEFT, {}, Twist(0.0, 0.8)),  # as fast as it spins
        (LEFT, {"heading": math.pi / 2 + 0.1}, Twist(0.0, -0.2)),
        (LEFT, {"heading": -math.pi}, Twist(0.0, -0.8)),  # the shorter way round
        (ON, {}, Twist(0.8, 0.0)),
        (REFUSED, {}, STILL),
        (RELEASE, {}, STILL),
        (RESET, {}, STILL),
        (CLEAR, {}, Twist(-0.4, 0.0)),
        (TURN_HOME, {"x": 2.0, "heading": math.pi}, Twist(0.0, 0.0)),
        (TURN_HOME, {"x": 2.0, "heading": math.pi - 0.1}, Twist(0.0, 0.2)),
        (HOME, {"x": 2.0, "heading": math.pi}, Twist(0.8, 0.0)),
        (HOME, {"x": 0.5, "heading": math.pi}, Twist(0.4, 0.0)),  # slower when near
        (HOME, {"x": 2.0, "heading": math.pi - 0.6}, Twist(0.0, 0.8)),  # looks home first
        (AS_AT_START, {"heading": -0.1}, Twist(0.0, 0.2)),
    ],
)
def test_what_a_step_asks_for(step: Step, pose: dict[str, float], twist: Twist) -> None:
    asked = step.drive(View(odometry(**pose), safety(), pressed=False), START)
    assert astuple(asked) == pytest.approx(astuple(twist))


def test_a_patient_lap_is_slower() -> None:
    patient = lap(fast=False, pace=PATIENT)
    assert patient[1].drive(view(), START) == Twist(PATIENT.cruise, 0.0)
    assert patient[2].drive(view(), START) == Twist(-PATIENT.careful, 0.0)
    assert patient[3].drive(view(), START) == Twist(0.0, PATIENT.spin)
    assert PATIENT.facing > QUICK.facing


# --- when each step is over -------------------------------------------------------------------

NORTH, WEST = math.pi / 2, math.pi


@pytest.mark.parametrize(
    ("step", "seen", "over"),
    [
        (WAIT, view(), True),
        (WAIT, view(verdict="slow"), True),
        (WAIT, view(verdict="stop"), False),
        (WAIT, view(verdict="inhibited"), False),
        (OFF, view("blocked", x=0.51), True),
        (OFF, view("blocked", x=0.5), False),  # blocked at the start
        (OFF, view("blocked", x=0.51, linear=0.021), False),
        (OFF, view("blocked", x=0.51, angular=-0.051), False),
        (OFF, view(x=0.51), False),
        (BACK, view(x=-0.4499), False),
        (BACK, view(x=-0.45), True),
        (LEFT, view(heading=NORTH - 0.029), True),
        (LEFT, view(heading=NORTH + 0.029), True),
        (LEFT, view(heading=NORTH - 0.031), False),
        (LEFT, view(heading=NORTH, angular=0.1), False),
        (ON, view("contact"), False),  # it has to be latched
        (ON, view(latched=("contact",)), True),
        (ON, view(latched=("runaway",)), False),
        (REFUSED, view(latched=("contact",)), False),
        (REFUSED, view(latched=("contact",), refusal="still pressed"), True),
        (RELEASE, view(pressed=True, x=-0.1), False),
        (RELEASE, view(x=-0.05), False),
        (RELEASE, view(x=-0.051), True),
        (RELEASE, view(refusal="nothing to release"), True),
        (RELEASE, view(pressed=True, refusal="no"), False),
        (RESET, view(latched=("contact",)), False),
        (RESET, view(), True),
        (CLEAR, view(y=-0.59), False),
        (CLEAR, view(y=-0.6), True),
        (TURN_HOME, view(x=2.0, heading=WEST), True),
        (TURN_HOME, view(x=2.0, heading=WEST - 0.04), False),
        (TURN_HOME, view(x=2.0, heading=WEST, angular=0.05), False),
        (HOME, view(x=0.099), True),
        (HOME, view(y=-0.1), False),
        (AS_AT_START, view(heading=0.02), True),
        (AS_AT_START, view(heading=0.04), False),
    ],
)
def test_when_a_step_is_over(step: Step, seen: View, over: bool) -> None:
    assert step.done(seen, START) is over


def test_a_step_measures_from_where_it_began() -> None:
    began = odometry(x=2.0, heading=0.5)
    assert not BACK.done(view(x=1.6), began)
    assert BACK.done(view(x=1.5), began)
    assert astuple(BACK.drive(view(heading=0.4), began)) == pytest.approx((-0.4, 0.2))


@pytest.mark.parametrize(("angle", "wrapped"), [(0.0, 0.0), (4.0, 4.0 - math.tau), (-7.0, -0.717)])
def test_angles_are_wrapped(angle: float, wrapped: float) -> None:
    assert wrap(angle) == pytest.approx(wrapped, abs=1e-3)


# --- from step to step ------------------------------------------------------------------------


def test_a_step_begins_where_the_vehicle_is_and_its_time_is_kept() -> None:
    it = Lap(lap(fast=True))
    assert it.seconds(NS_PER_S) == 0.0
    assert it.advance(view(verdict="stop"), 5 * NS_PER_S) == Ask()
    assert it.advance(view(), 6 * NS_PER_S) == Ask()  # over: the next begins at the next beat
    assert (it.index, it.began, it.times_ns) == (1, None, [5 * NS_PER_S])
    assert it.advance(view(x=0.1), 7 * NS_PER_S) == Ask(Twist(0.8, 0.0))
    assert it.began == odometry(x=0.1)
    assert it.times_ns == [5 * NS_PER_S, 7 * NS_PER_S]
    assert it.seconds(9 * NS_PER_S) == 4.0


def test_the_end_is_the_end() -> None:
    it = Lap((Step("only", still, lambda *_: True),))
    it.advance(view(), 0)
    assert it.step is None
    assert it.advance(view(), NS_PER_S) == Ask()
    assert it.index == 1


def at(name: str) -> Lap:
    """Return a lap in the step of that name."""
    return Lap(STEPS, index=NAMES.index(name))


def test_a_step_about_a_latch_presses_its_button() -> None:
    assert at("reset, refused").advance(view(latched=("contact",)), 0) == Ask(press="reset")
    assert at("release").advance(view(latched=("contact",)), 0) == Ask(press="release")


def test_what_safety_wants_neutral_is_neutral() -> None:
    assert at("drive on").advance(view("neutral"), 0) == Ask()
    assert at("release").advance(view("neutral"), 0) == Ask(press="release")


def test_a_stop_that_passes_is_waited_for() -> None:
    it = at("drive on")
    assert it.advance(view("bumper_old"), 0) == Ask(Twist(0.8, 0.0))
    assert it.unplanned == []


def test_a_latch_that_was_not_meant_is_reset_and_counted_once() -> None:
    it = at("drive off to the wall")
    for _ in range(3):
        assert it.advance(view(latched=("runaway",)), 0) == Ask(press="reset")
    assert it.unplanned == ["runaway"]
    assert it.advance(view(latched=("runaway", "estop")), 0) == Ask(press="reset")
    assert it.unplanned == ["runaway", "runaway, estop"]
    assert it.index == 1
    assert it.advance(view(), 0) == Ask(Twist(0.8, 0.0))


def test_the_same_latch_again_counts_again() -> None:
    it = at("drive off to the wall")
    for latched in (("runaway",), (), ("runaway",)):
        it.advance(view(latched=latched), 0)
    assert it.unplanned == ["runaway", "runaway"]
