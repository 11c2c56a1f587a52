"""The body on its four driven and steered wheels: how its velocity and its pose follow a command.

Both axles steer, so that the body turns around any point of its own y axis, or on the spot; the
wheels' angles follow from the twist alone. Wheels that are held by an obstacle stand.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from common.motion import STILL, Twist, clamp
from common.settings import Vehicle
from common.wire.commands import MotionKind
from sim.config import Drive
from sim.geometry import Pose

BISECTIONS = 12  # of one step's way, 15 mm at 1.5 m/s: contact is found to some micrometres


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel's steering angle, rad within a quarter turn, and its speed, m/s."""

    angle: float
    speed: float


@dataclass(frozen=True, slots=True)
class Way:
    """What became of one step: the pose after it, and how far and around it really went."""

    pose: Pose
    distance: float  # m, forward positive
    turn: float  # rad
    held: bool  # an obstacle ended it early


def next_twist(twist: Twist, kind: MotionKind, target: Twist, drive: Drive, dt: float) -> Twist:
    """Return the velocity after ``dt`` seconds under a command (manual 2.2)."""
    if kind is MotionKind.BREAK:
        return STILL
    if kind is MotionKind.STOP:
        return Twist(
            _toward(twist.linear, 0.0, drive.coast * dt),
            _toward(twist.angular, 0.0, drive.angular_coast * dt),
        )
    return Twist(
        _toward(twist.linear, clamp(target.linear, drive.max_linear), drive.acceleration * dt),
        _toward(
            twist.angular,
            clamp(target.angular, drive.max_angular),
            drive.angular_acceleration * dt,
        ),
    )


def moved(pose: Pose, twist: Twist, dt: float) -> Pose:
    """Return the pose after an exact arc of ``dt`` seconds."""
    half = twist.angular * dt / 2
    chord = twist.linear * dt * (math.sin(half) / half if half else 1.0)
    course = pose.heading + half
    return Pose(pose.x + chord * math.cos(course), pose.y + chord * math.sin(course), course + half)


def go(pose: Pose, twist: Twist, dt: float, blocked: Callable[[Pose], bool]) -> Way:
    """Move for ``dt`` seconds, or as far as nothing blocks; ``pose`` itself must be free."""
    ahead = moved(pose, twist, dt)
    if not blocked(ahead):
        return Way(ahead, twist.linear * dt, twist.angular * dt, held=False)
    free, hit = 0.0, dt
    for _ in range(BISECTIONS):
        middle = (free + hit) / 2
        free, hit = (free, middle) if blocked(moved(pose, twist, middle)) else (middle, hit)
    end = moved(pose, twist, free)
    return Way(end, twist.linear * free, twist.angular * free, held=True)


def wheels(twist: Twist, vehicle: Vehicle) -> tuple[Wheel, Wheel, Wheel, Wheel]:
    """Return front left, front right, rear left and rear right."""
    x, y = vehicle.wheelbase / 2, vehicle.track / 2
    return (
        _wheel(twist, x, y),
        _wheel(twist, x, -y),
        _wheel(twist, -x, y),
        _wheel(twist, -x, -y),
    )


def _wheel(twist: Twist, x: float, y: float) -> Wheel:
    # Adding 0.0 turns -0.0 into 0.0, which atan2 would take for backward.
    forward, left = twist.linear - twist.angular * y + 0.0, twist.angular * x + 0.0
    speed = math.hypot(forward, left)
    if forward < 0:  # a wheel rolls backward rather than turn around
        return Wheel(math.atan2(-left, -forward), -speed)
    return Wheel(math.atan2(left, forward), speed)


def _toward(value: float, target: float, most: float) -> float:
    return value + clamp(target - value, most)
