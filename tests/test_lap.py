"""The demo's lap with the shipped settings, in simulated time."""

from dataclasses import replace
from functools import cache

import pytest

from cli.demo.lap import Lap
from cli.demo.score import Trace, good, results, stops
from sim import trace as t
from tests.simulated_robot import SimulatedStack, simulated_robot

pytestmark = pytest.mark.simulated


@cache
def driven() -> tuple[SimulatedStack, list[str]]:
    """Drive a lap; return the stack and what it prints."""
    stack, shown = SimulatedStack(), list[str]()
    with simulated_robot(stack) as robot:
        Lap(robot, 1.0, check=lambda: None, show=shown.append).drive()
    return stack, shown


def trace_of(stack: SimulatedStack) -> Trace:
    return Trace(
        [r for r in stack.vehicle.records if isinstance(r, t.Truth)],
        [r for r in stack.vehicle.records if isinstance(r, t.Command)],
        [r for r in stack.vehicle.records if isinstance(r, t.BumperSent)],
    )


def test_the_lap_is_driven_as_it_should_be() -> None:
    stack, _ = driven()
    trace = trace_of(stack)
    rows = results(trace)
    assert good(rows), rows
    assert stack.oracle.violations == []
    assert min(x.clearance for x in trace.truth if x.clearance is not None) > 0.15
    (stop,) = stops(trace)
    assert stop.reaction_s is not None
    assert stop.reaction_s < 0.02


def test_a_lap_without_a_reaction_to_the_bumper_is_not_good() -> None:
    trace = trace_of(driven()[0])
    hit_ns = next(hit.mono_ns for hit in trace.bumper if hit.pressed)
    moving = [x for x in trace.truth if x.mono_ns <= hit_ns or abs(x.linear) > 0.001]
    for changed, wrong in (
        (replace(trace, commands=[]), "contact 1: frame to BRAKE frame"),
        (replace(trace, truth=moving), "contact 1: stopped within"),
        (replace(trace, truth=trace.truth[: len(trace.truth) // 2]), "distance from the start"),
        (replace(trace, bumper=[]), ""),
    ):
        rows = results(changed)
        assert not good(rows)
        assert any(what.startswith(wrong) and not fine for what, _, fine in rows) or not wrong


def test_safety_answers_as_the_steps_expect() -> None:
    stack, shown = driven()
    answers = stack.answers
    assert (answers[0], answers[-1]) == (False, True)
    refused, granted = shown.index("  reset, refused"), shown.index("  reset")
    assert shown[refused + 1].startswith("    refused: ")
    assert shown[granted + 1].startswith("    granted: ")
    assert shown[granted + 2 :] == [
        "  back off",
        "  turn home",
        "  drive home",
        "  turn as at the start",
    ]
