"""Vehicle dynamics: velocity and pose of a body on four driven and steered wheels.

Both axles steer, so that the body turns around any point of its own y axis, or on the spot; the
wheel angles follow from the twist alone. Wheels blocked by an obstacle stand still.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from common.motion import STILL, Twist, clamp
from common.settings import Vehicle
from common.wire.commands import MotionKind
from sim.config import Drive
from sim.geometry import Pose

WHEELS = 4
SETTLED = 1e-4  # m/s or rad/s from its target, where a lag ends
BISECTIONS = 12  # of one step, 15 mm at 1.5 m/s: contact is found to a few micrometres


@dataclass(frozen=True, slots=True)
class Movement:
    """Result of one step: the new pose, and the actual distance and turn."""

    pose: Pose
    distance: float  # m, forward positive
    turn: float  # rad
    held: bool  # an obstacle ended it early


def next_twist(twist: Twist, kind: MotionKind, target: Twist, drive: Drive, dt: float) -> Twist:
    """Return the velocity after ``dt`` seconds under a command (manual 2.2)."""
    goal, force, share = STILL, 1 - drive.weak_wheel / WHEELS, dt / (dt + drive.lag)
    if kind is MotionKind.BREAK:
        linear, angular, force, share = drive.brake, drive.angular_brake, 1.0, 1.0
    elif kind is MotionKind.STOP:
        linear, angular = drive.coast, drive.angular_coast
    else:
        linear, angular = drive.acceleration, drive.angular_acceleration
        goal = Twist(
            clamp(target.linear, drive.max_linear), clamp(target.angular, drive.max_angular)
        )
    return Twist(
        _toward(twist.linear, goal.linear, linear * force * dt, share),
        _toward(twist.angular, goal.angular, angular * force * dt, share),
    )


def rebounded(twist: Twist, share: float) -> Twist:
    """Return the velocity after a contact, from the one before."""
    return Twist(-share * twist.linear, -share * twist.angular) if share else STILL


def moved(pose: Pose, twist: Twist, dt: float) -> Pose:
    """Return the pose after an exact arc of ``dt`` seconds."""
    half = twist.angular * dt / 2
    chord = twist.linear * dt * (math.sin(half) / half if half else 1.0)
    course = pose.heading + half
    return Pose(pose.x + chord * math.cos(course), pose.y + chord * math.sin(course), course + half)


def move(pose: Pose, twist: Twist, dt: float, blocked: Callable[[Pose], bool]) -> Movement:
    """Move for ``dt`` seconds, or up to the first obstacle; ``pose`` itself must be free."""
    ahead = moved(pose, twist, dt)
    if not blocked(ahead):
        return Movement(ahead, twist.linear * dt, twist.angular * dt, held=False)
    free, hit = 0.0, dt
    for _ in range(BISECTIONS):
        middle = (free + hit) / 2
        free, hit = (free, middle) if blocked(moved(pose, twist, middle)) else (middle, hit)
    end = moved(pose, twist, free)
    return Movement(end, twist.linear * free, twist.angular * free, held=True)


def wheel_angles(twist: Twist, vehicle: Vehicle) -> tuple[float, ...]:
    """Return the steering angles of the wheels, rad within a quarter turn.

    Front left, front right, rear left, rear right.
    """
    x, y = vehicle.wheelbase / 2, vehicle.track / 2
    return tuple(_wheel_angle(twist, *at) for at in ((x, y), (x, -y), (-x, y), (-x, -y)))


def _wheel_angle(twist: Twist, x: float, y: float) -> float:
    # Adding 0.0 turns -0.0 into 0.0, which atan2 would take for backward.
    forward, left = twist.linear - twist.angular * y + 0.0, twist.angular * x + 0.0
    if forward < 0:  # a wheel rolls backward instead of turning around
        return math.atan2(-left, -forward)
    return math.atan2(left, forward)


def _toward(value: float, target: float, most: float, share: float) -> float:
    """Return a value nearer to its target: by this share of the way, and by so much at most."""
    way = target - value
    return value + clamp(way if abs(way) < SETTLED else way * share, most)
