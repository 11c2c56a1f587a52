"""The oracle observes drives, and objects to a stack with a protection removed."""

import pytest

from common.messages import Direction
from common.motion import Twist
from tests.invariants.mutations import MUTATIONS, driving, hold
from tests.invariants.mutations_operator import OPERATOR_MUTATIONS
from tests.invariants.mutations_safety import SAFETY_MUTATIONS, driver_blinks
from verification.invariants.stack import Stack

ALL = MUTATIONS | OPERATOR_MUTATIONS | SAFETY_MUTATIONS


def test_a_drive_is_observed_without_violations() -> None:
    stack = driving()
    assert stack.oracle.runs > 50
    assert stack.oracle.violations == []


def test_a_hit_stops_and_only_reset_and_neutral_let_it_drive_again() -> None:
    stack = driving()
    stack.vehicle.pressed = True
    stack.run(300)
    stack.vehicle.pressed = False
    runs = stack.oracle.runs
    stack.run(3000)
    assert (stack.oracle.runs, stack.vehicle.twist.linear) == (runs, 0.0)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(600)
    assert stack.reset()
    stack.run(200)
    stack.sticks["teleop"].requested = (0.5, 0.0)
    stack.run(500)
    assert stack.oracle.runs > runs
    assert stack.oracle.violations == []


def stuck() -> Stack:
    """Return a stack that drove into something and stands there, with an emergency stop."""
    stack = driving()
    stack.vehicle.pressed = True
    stack.estop()
    stack.sticks["teleop"].requested = None
    stack.run(2000)
    return stack


def test_a_pressed_bumper_is_released_after_a_reset_and_not_before() -> None:
    stack = stuck()
    runs = stack.oracle.runs
    hold(stack)
    assert stack.oracle.runs == runs
    assert stack.reset()
    hold(stack)
    assert stack.oracle.runs > runs
    assert -0.11 < stack.vehicle.twist.linear < -0.05
    assert [trip.name for trip in stack.oracle.trips] == ["contact"]
    assert stack.oracle.violations == []


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_the_operator_chooses_the_direction(direction: Direction) -> None:
    stack = stuck()
    stack.reset()
    runs = stack.oracle.runs
    hold(stack, direction)
    assert stack.oracle.runs > runs
    # The board's own brake lets no RUN pass toward what was hit.
    assert (stack.vehicle.twist.linear < 0) == (direction == "backward")
    assert stack.oracle.violations == []


def test_a_motion_without_a_command_wants_a_reset_of_the_next_safety() -> None:
    stack = driving()
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    stack.kill("safety", 3000)
    stack.run(1000)
    stack.vehicle.measured = Twist(0.3)
    stack.run(600)
    stack.vehicle.measured = None
    stack.run(3000)
    assert stack.seen is not None
    assert "predecessor" in [cause.name for cause in stack.seen.causes]
    runs = stack.oracle.runs
    stack.sticks["teleop"].requested = (0.5, 0.0)
    stack.run(1000)
    assert stack.oracle.runs == runs
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(700)
    assert stack.reset()
    stack.run(700)
    stack.sticks["teleop"].requested = (0.5, 0.0)
    stack.run(500)
    assert stack.oracle.runs > runs
    assert stack.oracle.violations == []


@pytest.mark.parametrize("late_ms", [450, 2000, 4000])
def test_twenty_late_holds_give_no_run(late_ms: int) -> None:
    stack = stuck()
    stack.reset()
    runs, made = stack.oracle.runs, []
    for _ in range(20):
        made.append(stack.seen)
        stack.run(late_ms // 20)
    stack.run(late_ms)
    assert [stack.hold(True, "backward", seen) for seen in made[:20]] == [False] * 20
    assert stack.oracle.runs == runs
    assert stack.hold(True)


@pytest.mark.parametrize("hung_ms", [0, 60])
def test_a_fault_that_is_over_at_once_latches_however_late_it_is_read(hung_ms: int) -> None:
    stack = driving()
    stack.stall("safety", hung_ms)
    driver_blinks(stack)
    stack.run(300)
    runs = stack.oracle.runs
    stack.run(1000)
    assert [trip.name for trip in stack.oracle.trips] == ["driver"]
    assert (stack.oracle.runs, stack.vehicle.twist.linear) == (runs, 0.0)
    assert stack.oracle.violations == []


@pytest.mark.parametrize("name", ["safety", "bridge", "board", "router"])
def test_a_restarted_part_drives_after_a_neutral_request_and_not_before(name: str) -> None:
    stack = driving()
    if name == "board":
        stack.power_cycle(500)
    elif name == "router":
        stack.router(up=False)
        stack.run(500)
        stack.router(up=True)
    else:
        stack.kill(name, 300)
    stack.run(500)
    runs = stack.oracle.runs
    stack.run(1500)
    assert stack.oracle.runs == runs
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(700)
    assert stack.reset() == (name == "router")
    stack.run(700)
    stack.sticks["teleop"].requested = (0.5, 0.0)
    stack.run(500)
    assert stack.oracle.runs > runs
    assert stack.oracle.violations == []


@pytest.mark.parametrize("name", ALL)
def test_the_oracle_objects_to_a_missing_protection(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner, attribute, broken, scenario, objection = ALL[name]
    monkeypatch.setattr(owner, attribute, broken)
    stack = driving()
    assert stack.oracle.violations == []
    scenario(stack)
    stack.run(2000)
    assert any(objection in one for one in stack.oracle.violations), stack.oracle.violations[:5]


@pytest.mark.parametrize("name", ALL)
def test_the_same_scenario_is_harmless_with_the_protection(name: str) -> None:
    stack = driving()
    ALL[name][3](stack)
    stack.run(2000)
    assert stack.oracle.violations == []
