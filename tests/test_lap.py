"""The demo's lap with the shipped settings, in simulated time."""

from functools import cache

import pytest

from cli.demo.lap import QUICK, Lap
from cli.demo.score import Trace, good, results, stops
from sim import trace as t
from t2.messages import Odometry
from tests.cli.demo.lap_fixture import as_client
from tests.simulated_robot import SimulatedStack, simulated_robot


@cache
def driven() -> tuple[SimulatedStack, Lap, list[tuple[str, str]]]:
    """Drive a lap; return the stack, the lap, and safety's answers to its steps."""
    stack, answers = SimulatedStack(), []
    with pytest.MonkeyPatch.context() as patch, simulated_robot(stack, patch) as robot:
        lap = Lap(
            robot, QUICK, check=lambda: None,
            show=lambda step, answer: answers.append((step, answer)) if answer else None,
        )  # fmt: skip
        lap.drive()
    return stack, lap, answers


def trace_of(stack: SimulatedStack) -> Trace:
    return Trace(
        [r for r in stack.vehicle.records if isinstance(r, t.Truth)],
        [r for r in stack.vehicle.records if isinstance(r, t.Command)],
        [r for r in stack.vehicle.records if isinstance(r, t.BumperSent)],
    )


def test_the_lap_is_driven_as_it_should_be() -> None:
    stack, lap, _ = driven()
    trace = trace_of(stack)
    rows = results(trace, [as_client(pose, Odometry) for pose in stack.poses], lap)
    assert good(rows), rows
    assert lap.unplanned == []
    assert stack.oracle.violations == []
    assert min(x.clearance for x in trace.truth if x.clearance is not None) > 0.15
    (stop,) = stops(trace)
    assert stop.reaction_s is not None
    assert stop.reaction_s < 0.02


def test_safety_answers_as_the_steps_expect() -> None:
    stack, _, shown = driven()
    answers = stack.answers
    assert (answers[0], answers[-1]) == (False, True)
    assert shown[0][0] == "reset, refused"
    assert shown[0][1].startswith("refused: ")
    assert shown[-1][0] == "reset"
    assert shown[-1][1].startswith("granted: ")
