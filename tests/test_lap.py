"""The demo's lap with the shipped settings, in simulated time."""

import threading
from functools import cache

import pytest

from cli.demo.driver import Driver
from cli.demo.lap import QUICK, drive_lap
from cli.demo.record import LapRecord
from cli.demo.score import Trace, good, results, stops
from sim import trace as t
from t2.messages import Odometry
from tests.cli.demo.lap_fixture import as_client
from tests.simulated_robot import SimulatedStack, simulated_robot

pytestmark = pytest.mark.no_cover  # whole laps; the cores have tests of their own


@cache
def driven() -> tuple[SimulatedStack, LapRecord]:
    """Drive a lap; return the stack and the record after it."""
    stack, record = SimulatedStack(), LapRecord()
    with pytest.MonkeyPatch.context() as patch, simulated_robot(stack, patch) as robot:
        drive_lap(Driver(robot, record, threading.Event()), QUICK)
    record.finished = True
    record.odometry = [as_client(pose, Odometry) for pose in stack.poses]
    return stack, record


def trace_of(stack: SimulatedStack) -> Trace:
    return Trace(
        [r for r in stack.vehicle.records if isinstance(r, t.Truth)],
        [r for r in stack.vehicle.records if isinstance(r, t.Command)],
        [r for r in stack.vehicle.records if isinstance(r, t.BumperSent)],
    )


def test_the_lap_is_driven_as_it_should_be() -> None:
    stack, record = driven()
    trace = trace_of(stack)
    rows = results(trace, record, fast=False)
    assert good(rows), rows
    assert record.unplanned == []
    assert stack.oracle.violations == []
    assert min(x.clearance for x in trace.truth if x.clearance is not None) > 0.15
    (stop,) = stops(trace)
    assert stop.reaction_s is not None
    assert stop.reaction_s < 0.02


def test_safety_answers_as_the_steps_expect() -> None:
    stack, record = driven()
    answers = stack.answers
    assert (answers[0], answers[-1]) == (False, True)
    assert record.answers[0][:2] == ("reset, refused", False)
    assert record.answers[-1][:2] == ("reset", True)


def test_the_same_lap_twice_is_the_same() -> None:
    first = driven()[0].vehicle.records
    driven.cache_clear()
    assert driven()[0].vehicle.records == first
