"""Mutations of operator calls: remove one protection each, with the expected objection."""

from typing import Any

from common.heartbeat import Heartbeat
from services.safety import latches
from services.safety.latches import Held
from services.safety.release import Release
from tests.invariants.mutations import Mutation, hold
from verification.invariants.stack import Stack


def standing_pressed(stack: Stack) -> None:
    stack.vehicle.pressed = True
    stack.sticks["teleop"].requested = None
    stack.run(1500)


def late_holds(stack: Stack) -> None:
    """Deliver calls that hold the release two seconds late."""
    standing_pressed(stack)
    seen = stack.seen
    stack.run(2000)
    for _ in range(20):
        stack.hold(True, "backward", seen)


def pressed_again(stack: Stack) -> None:
    """Touch something else while moving off."""
    standing_pressed(stack)
    hold(stack)
    stack.vehicle.pressed = False
    stack.run(150)
    stack.vehicle.pressed = True
    stack.run(700)
    hold(stack)


def pressed_again_and_again(stack: Stack) -> None:
    """Free the bumper repeatedly at standstill, and use the whole distance of each release."""
    standing_pressed(stack)
    for _ in range(4):
        hold(stack)
        stack.run(1500)
        stack.vehicle.pressed = False
        stack.run(300)
        stack.vehicle.pressed = True
        stack.run(300)


def reset_of_what_was_seen(stack: Stack) -> None:
    """Reset an emergency stop as it was seen before a contact that came meanwhile."""
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    stack.estop()
    stack.run(100)
    seen = stack.seen
    stack.vehicle.pressed = True
    stack.run(60)
    stack.vehicle.pressed = False
    stack.run(400)
    stack.reset(seen)
    stack.run(300)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def late_reset(stack: Stack) -> None:
    """Reset three seconds after what the operator saw; the bumper was touched meanwhile."""
    stack.sticks["teleop"].requested = (0.0, 0.0)
    stack.run(1500)
    for _ in range(2):
        stack.vehicle.pressed = True
        stack.run(60)
        seen = stack.seen
        stack.vehicle.pressed = False
        stack.run(40)
    stack.run(3000)
    stack.reset(seen)
    stack.run(300)
    stack.sticks["teleop"].requested = (0.5, 0.0)


def unforgetting(release: Release, old: Held | None, contact: Held, *rest: Any) -> Release:
    """Update a release, but forget earlier presses at each new press."""
    anew = contact.good == 0 and old is not None and old.good > 0
    return AFTER(Release() if anew else release, None if anew else old, contact, *rest)


AFTER = Release.after

OPERATOR_MUTATIONS: dict[str, Mutation] = {
    "late calls are obeyed": (
        Heartbeat, "refusal", lambda *_: "", late_holds, "no operator holds the release",
    ),
    "a late reset is obeyed": (
        Heartbeat, "refusal", lambda *_: "", late_reset, "safety knows of contact",
    ),
    "a reset clears what it does not name": (
        latches, "named", lambda held, _: latches.latched(held), reset_of_what_was_seen,
        "safety knows of contact",
    ),
    "each press has its full distance again": (
        Release, "after", unforgetting, pressed_again_and_again, "farther than its way",
    ),
    "no direction is forbidden": (
        Release, "after", unforgetting, pressed_again, "in which the bumper was pressed",
    ),
}  # fmt: skip
