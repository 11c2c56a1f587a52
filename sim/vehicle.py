"""Vehicle dynamics: motors, velocity and pose of a body on four driven and steered wheels.

Both axles steer, so that the body turns around any point of its own y axis, or on the spot. Wheels
blocked by an obstacle stand still. Motors are ideal by default; both sides are driven by the speed
of their middle::

    command -> dead time -> sides: dead zone, asymmetry, weak wheel -> ramp and lag -> slope
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from common.motion import STILL, Twist, clamp
from common.wire.commands import MotionKind
from sim.geometry import Pose
from sim.model import Drive

WHEELS = 4
GRAVITY = 9.81  # m/s^2
SETTLED = 1e-4  # m/s or rad/s from its target, where a lag ends
BISECTIONS = 12  # of one step, 15 mm at 1.5 m/s: contact is found to a few micrometres

Command = tuple[MotionKind, Twist]


@dataclass(frozen=True, slots=True)
class Movement:
    """Result of one step: the new pose, and the actual distance and turn."""

    pose: Pose
    distance: float  # m, forward positive
    turn: float  # rad
    held: bool  # an obstacle ended it early


class Motors:
    """The motors of one vehicle.

    track: m, left wheels to right wheels.
    """

    def __init__(self, drive: Drive, track: float) -> None:
        self._drive = drive
        self._track = track
        self._pending: deque[Command] = deque()
        self._command: Command = MotionKind.STOP, Twist()
        self._released = False  # STOP has come to a standstill, and holds no more

    def follow(self, twist: Twist, kind: MotionKind, target: Twist, dt: float) -> Twist:
        """Return the velocity ``dt`` seconds later under the command that the board gives now."""
        kind, target = self._delayed((kind, target), dt)
        if kind is MotionKind.RUN:
            target = self._uneven(target)
        after = next_twist(twist, kind, target, self._drive, dt)
        self._released = kind is MotionKind.STOP and (self._released or after.linear == 0)
        if not (self._released and self._drive.slope):
            return after
        rolling = twist.linear + GRAVITY * math.sin(self._drive.slope) * dt
        return Twist(clamp(rolling, self._drive.max_linear), after.angular)

    def _delayed(self, command: Command, dt: float) -> Command:
        self._pending.append(command)
        if len(self._pending) > round(self._drive.dead_time / dt):
            self._command = self._pending.popleft()
        return self._command

    def _uneven(self, target: Twist) -> Twist:
        drive = self._drive
        if not (drive.dead_zone or drive.asymmetry or drive.weak_wheel):
            return target
        aside = target.angular * self._track / 2
        left, right = (
            0.0 if abs(speed) < drive.dead_zone else speed
            for speed in (target.linear - aside, target.linear + aside)
        )
        left *= (1 - drive.asymmetry / 2) * (1 - 2 * drive.weak_wheel / WHEELS)
        right *= 1 + drive.asymmetry / 2
        return Twist((left + right) / 2, (right - left) / self._track)


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


def _toward(value: float, target: float, most: float, share: float) -> float:
    """Return a value nearer to its target: by this share of the way, and by so much at most."""
    way = target - value
    return value + clamp(way if abs(way) < SETTLED else way * share, most)
