"""Mutations of safety: standstill supervision, source priority and sonar overrides."""

from collections.abc import Callable
from typing import Any

from common.motion import Twist
from services.safety.arbiter import Arbiter
from services.safety.sonar_array import SonarOverrides
from services.safety.standstill import Standstill, Supervisor
from tests.invariants.stack import Stack

FAULT_MM = 0xFFFF


def never_stops(stack: Stack) -> None:
    stack.vehicle.measured = Twist(0.28)
    stack.sticks["teleop"].requested = None


def pushed(stack: Stack) -> None:
    stack.sticks["teleop"].requested = None
    stack.run(2500)
    stack.vehicle.measured = Twist(0.28)


def nav_goes_on(stack: Stack) -> None:
    """Overrule nav by teleop, then end teleop's requests."""
    stack.sticks["teleop"].requested, stack.sticks["nav"].requested = None, (0.0, 0.0)
    stack.run(1000)
    stack.sticks["nav"].requested = (0.3, 0.0)
    stack.run(300)
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(300)
    stack.sticks["teleop"].requested = None


def goes_on_blind(stack: Stack) -> None:
    """Fail the front sonar while the operator holds the stick."""
    stack.vehicle.ranges[2] = FAULT_MM


def knows_at_once(overrides: SonarOverrides, unseen: Any, _: Any, now_ns: int) -> SonarOverrides:
    return SonarOverrides(dict.fromkeys(unseen, now_ns), {"teleop": frozenset(unseen)})


SAFETY_MUTATIONS: dict[str, tuple[object, str, object, Callable[[Stack], None], str]] = {
    "a stop is not supervised": (
        Standstill, "is_late", lambda *_: False, never_stops, "no BRAKE while",
    ),
    "a standstill is not supervised": (
        Supervisor, "_stay", lambda self, standstill, *_: standstill, pushed, "no BRAKE while",
    ),
    "an override does not hold": (
        Arbiter, "overruled", lambda self, _: self, nav_goes_on, "nav was not neutral",
    ),
    "a hold that was meant for a good sonar drives on blind": (
        SonarOverrides, "updated", knows_at_once, goes_on_blind, "toward sonar 2",
    ),
}  # fmt: skip
