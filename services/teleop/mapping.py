"""Keys and sticks to a twist, in ``base_link``: m/s and rad/s, x forward, counter-clockwise.

A key gives a direction, a stick gives a deflection; both are -1..1 for each of the two axes, and
the gear says how fast 1 is. Backward to the left means that the tail goes left, as in a car.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from common import codec
from common.motion import Twist, clamp
from services.teleop.config import Teleop


@dataclass(frozen=True, slots=True)
class Deflection:
    """How far the operator pushes, -1..1: forward and counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class Stick:
    """What a gamepad shows at one moment."""

    push: Deflection
    deadman: bool  # held down; without it the sticks mean nothing
    turbo: bool
    events: int = 0  # how many the gamepad has sent since it was found


# The keypad without NumLock sends home, pageup, end and pagedown from its corners. A terminal
# repeats one key only, so an arc needs a key of its own.
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
    """Return what the held keys ask together; opposite ones cancel out."""
    pushes = [DIRECTIONS[key] for key in held]
    return Deflection(
        clamp(sum(push.linear for push in pushes), 1.0),
        clamp(sum(push.angular for push in pushes), 1.0),
    )


def shaped(raw: Deflection, deadzone: float, expo: float) -> Deflection:
    """Return a stick's push without the play around its middle, fine there and full at the end."""
    return Deflection(_shape(raw.linear, deadzone, expo), _shape(raw.angular, deadzone, expo))


def twist(push: Deflection, gear: int, turbo: bool, settings: Teleop) -> Twist:
    """Return the motion that a push asks in a gear, 1 to 5; turbo takes the place of the gear."""
    linear = settings.turbo_linear if turbo else settings.gears_linear[gear - 1]
    angular = settings.turbo_angular if turbo else settings.gears_angular[gear - 1]
    return Twist(push.linear * linear, push.angular * angular)


def _shape(raw: float, deadzone: float, expo: float) -> float:
    if not codec.finite(raw) or abs(raw) <= deadzone:
        return 0.0
    way = min(1.0, (abs(raw) - deadzone) / (1.0 - deadzone))
    bent = expo * way**3 + (1.0 - expo) * way
    return bent if raw > 0 else -bent
