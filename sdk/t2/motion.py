"""Motions by odometry: how much is left, and which velocity to request. Pure."""

import math
from typing import NamedTuple

from t2.messages import MAX_NUMBER, Odometry

ACCELERATION, TURNING = 0.3, 0.8  # m/s^2, rad/s^2: how a motion slows down towards its end
SLOWEST, SLOWEST_TURN = 0.05, 0.1  # m/s, rad/s: an end that is reached
NEAR, NEAR_TURN = 0.01, 0.02  # m, rad: of the end
KEEP_HEADING, MAX_CORRECTION = 1.5, 0.4  # rad/s per rad, rad/s


class Target(NamedTuple):
    """A requested velocity, with its end."""

    linear: float  # m/s
    angular: float  # rad/s
    end_s: float = math.inf  # monotonic time

    @property
    def moves(self) -> bool:
        """Whether it is not zero."""
        return self.linear != 0 or self.angular != 0


STILL = Target(0.0, 0.0)


class Straight:
    """A distance in m along the heading at the start; negative is backward."""

    near = NEAR

    def __init__(self, start: Odometry, distance: float, speed: float) -> None:
        self._start, self._speed = start, positive(speed)
        self._distance, self._sign = abs(finite(distance)), math.copysign(1.0, distance)

    def left(self, pose: Odometry) -> float:
        """Return the distance that is left, m."""
        start = self._start
        way = (pose.x - start.x) * math.cos(start.heading)
        way += (pose.y - start.y) * math.sin(start.heading)
        return self._distance - self._sign * way

    def velocity(self, pose: Odometry, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""
        correction = KEEP_HEADING * math.remainder(self._start.heading - pose.heading, math.tau)
        bounded = max(-MAX_CORRECTION, min(MAX_CORRECTION, correction))
        return self._sign * slowing(left, self._speed, ACCELERATION, SLOWEST), bounded


class Turn:
    """An angle in rad on the spot, positive to the left; may be more than a whole turn."""

    near = NEAR_TURN

    def __init__(self, start: Odometry, angle: float, speed: float) -> None:
        self._angle, self._sign = abs(finite(angle)), math.copysign(1.0, angle)
        self._speed = positive(speed)
        self._heading, self._turned = start.heading, 0.0

    def left(self, pose: Odometry) -> float:
        """Return the angle that is left, rad; call it for each pose."""
        self._turned += math.remainder(pose.heading - self._heading, math.tau)
        self._heading = pose.heading
        return self._angle - self._sign * self._turned

    def velocity(self, _: Odometry, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""
        return 0.0, self._sign * slowing(left, self._speed, TURNING, SLOWEST_TURN)


def slowing(left: float, speed: float, deceleration: float, slowest: float) -> float:
    """Return the speed at this distance from the end."""
    return max(slowest, min(speed, math.sqrt(2 * deceleration * max(left, 0.0))))


def finite(number: float) -> float:
    """Return a number, of NumPy for example, as a float; raise ``ValueError`` or ``TypeError``."""
    if not abs(number) <= MAX_NUMBER:
        raise ValueError(f"only finite numbers up to {MAX_NUMBER:g} are possible, not {number}")
    return float(number)


def positive(speed: float) -> float:
    """Return a speed likewise; raise ``ValueError`` for one that is not positive, too."""
    if not 0 < speed < math.inf:
        raise ValueError(
            f"speed must be positive, not {speed}; a negative distance drives backward"
        )
    return finite(speed)
