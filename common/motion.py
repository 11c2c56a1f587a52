"""Planar motion: the twist, the three motion commands, and the standstill threshold.

Frames follow REP-103: in ``base_link``, m/s forward positive and rad/s counter-clockwise positive.
"""

import math

from msgspec import Struct

from t2.messages import Command

# A measured velocity below both counts as standstill.
STANDING_MPS = 0.02
STANDING_RADPS = 0.05  # 3 deg/s: the board resolves 0.1 deg/s, its sensor is noisier
# Half of the resolution of a motion frame: 1 mm/s and 0.1 deg/s.
ROUNDED_MPS = 0.0005
ROUNDED_RADPS = math.radians(0.05)


# For hot paths: before Python 3.12 each ``Command.RUN`` calls a Python function.
RUN, STOP, BRAKE = Command


class Twist(Struct, frozen=True):
    """A planar velocity in ``base_link``."""

    linear: float = 0.0  # m/s, forward positive
    angular: float = 0.0  # rad/s, counter-clockwise positive

    @property
    def is_zero(self) -> bool:
        """Whether it is exactly zero: a neutral request."""
        return self.linear == 0 and self.angular == 0

    @property
    def rounds_to_zero(self) -> bool:
        """Whether the motion frame for it commands zero."""
        return abs(self.linear) <= ROUNDED_MPS and abs(self.angular) <= ROUNDED_RADPS

    @property
    def is_standing(self) -> bool:
        """Whether it counts as standstill when measured."""
        return abs(self.linear) < STANDING_MPS and abs(self.angular) < STANDING_RADPS

    def scaled(self, factor: float) -> "Twist":
        """Return the twist slower or faster on the same curve."""
        return Twist(self.linear * factor, self.angular * factor)

    def within(self, linear: float, angular: float) -> "Twist":
        """Return the twist slowed on the same curve to these magnitudes (m/s, rad/s)."""
        over = max(abs(self.linear) / linear, abs(self.angular) / angular, 1.0)
        return self.scaled(1 / over)


STILL = Twist()


def clamp(value: float, limit: float) -> float:
    """Return the value limited to ``-limit`` to ``limit``."""
    return max(-limit, min(limit, value))
