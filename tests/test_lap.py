"""The demo's lap with the shipped settings, in simulated time."""

from collections.abc import Callable
from functools import cache

import pytest

from cli.demo.score import Trace, good, results, stops
from cli.demo.script import PATIENT, QUICK, Lap, Pace, lap
from sim import trace as t
from tests.simulated_stack import SimulatedStack

LAP_S = 60.0


def driven(pace: Pace, seconds: float) -> SimulatedStack:
    it = SimulatedStack(Lap(lap(fast=False, pace=pace)))
    for _ in it.run(seconds):
        if it.lap.step is None:
            break
    return it


def trace_of(it: SimulatedStack) -> Trace:
    return Trace(
        [r for r in it.records if isinstance(r, t.Truth)],
        [r for r in it.records if isinstance(r, t.Command)],
        [r for r in it.records if isinstance(r, t.BumperSent)],
    )


@cache
def quick() -> SimulatedStack:
    return driven(QUICK, LAP_S)


@cache
def patient() -> SimulatedStack:
    return driven(PATIENT, 2 * LAP_S)


@pytest.mark.parametrize("made", [quick, pytest.param(patient, marks=pytest.mark.campaign)])
def test_the_lap_is_driven_as_it_should_be(made: Callable[[], SimulatedStack]) -> None:
    it = made()
    assert it.lap.step is None, f"stuck at: {it.lap.step.name}"
    trace = trace_of(it)
    rows = results(trace, it.odometry, it.lap, fast=False)
    assert good(rows), rows
    assert it.lap.unplanned == []
    assert min(x.clearance for x in trace.truth if x.clearance is not None) > 0.15
    (stop,) = stops(trace)
    assert stop.reaction_s is not None
    assert stop.reaction_s < 0.02


def test_safety_answers_as_the_story_says() -> None:
    it = quick()
    said = [(kind, done) for kind, done, _ in it.answers]
    first_reset = said.index(("Reset", False))
    first_hold = said.index(("Hold", True))
    last_reset = len(said) - 1 - said[::-1].index(("Reset", True))
    assert first_reset < first_hold < last_reset


def test_the_same_lap_twice_is_the_same() -> None:
    again = driven(QUICK, 9.0)
    assert again.records == quick().records[: len(again.records)]
