"""Motors between the board's command and the wheels: dead time, unlike sides, and a slope.

Each part is off by default. Both sides are driven by the speed of their middle::

    command -> dead time -> sides: dead zone, asymmetry, weak wheel -> ramp and lag -> slope
"""

import math
from collections import deque

from common.motion import Twist, clamp
from common.wire.commands import MotionKind
from sim.config import Drive
from sim.vehicle import WHEELS, next_twist

GRAVITY = 9.81  # m/s^2

Command = tuple[MotionKind, Twist]


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
