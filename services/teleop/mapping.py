"""Mapping of keys and sticks to a twist in ``base_link``: m/s and rad/s, counter-clockwise.

A key gives a direction, a stick a deflection: -1..1 on each of the two axes. The gear sets the
speed of full deflection. Backward left means that the rear goes left, as in a car.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from common import codec
from common.motion import Twist, clamp
from services.teleop.config import Teleop


@dataclass(frozen=True, slots=True)
class Deflection:
    """Deflection of a control, -1..1: forward and counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class Stick:
    """State of a gamepad."""

    push: Deflection
    deadman: bool  # held down; without it the sticks are ignored
    turbo: bool
    events: int = 0  # received since the gamepad was found


# The keypad without NumLock sends home, pageup, end and pagedown from its corners. A terminal
# repeats one key only, so each arc has its own key.
DIRECTIONS = {
    "w": Deflection(1, 0), "up": Deflection(1, 0),
    "s": Deflection(-1, 0), "down": Deflection(-1, 0),
    "a": Deflection(0, 1), "left": Deflection(0, 1),
    "d": Deflection(0, -1), "right": Deflection(0, -1),
    "z": Deflection(1, 1), "home": Deflection(1, 1),
    "c": Deflection(1, -1), "pageup": Deflection(1, -1),
    "end": Deflection(-1, -1), "pagedown": Deflection(-1, 1),
}  # fmt: skip


def deflection(held: Iterable[str]) -> Deflection:
    """Return the deflection of all held keys; opposite keys cancel out."""
    pushes = [DIRECTIONS[key] for key in held]
    return Deflection(
        clamp(sum(push.linear for push in pushes), 1.0),
        clamp(sum(push.angular for push in pushes), 1.0),
    )


def shaped(raw: Deflection, deadzone: float, expo: float) -> Deflection:
    """Return a stick's deflection after deadzone and expo curve; full deflection stays 1."""
    return Deflection(_shape(raw.linear, deadzone, expo), _shape(raw.angular, deadzone, expo))


def twist(push: Deflection, gear: int, turbo: bool, settings: Teleop) -> Twist:
    """Return the twist of a deflection in a gear, 1 to 5; turbo replaces the gear."""
    linear = settings.turbo_linear if turbo else settings.gears_linear[gear - 1]
    angular = settings.turbo_angular if turbo else settings.gears_angular[gear - 1]
    return Twist(push.linear * linear, push.angular * angular)


def _shape(raw: float, deadzone: float, expo: float) -> float:
    if not codec.finite(raw) or abs(raw) <= deadzone:
        return 0.0
    linear = min(1.0, (abs(raw) - deadzone) / (1.0 - deadzone))
    curved = expo * linear**3 + (1.0 - expo) * linear
    return curved if raw > 0 else -curved
