"""A planar velocity, and when a measured one counts as standstill."""

import math

from msgspec import Struct

STANDING_MPS = 0.02
STANDING_RADPS = 0.05  # 3 deg/s: the board resolves 0.1 deg/s, its sensor is noisier
# Half of the resolution of a motion frame: 1 mm/s and 0.1 deg/s.
ROUNDED_MPS = 0.0005
ROUNDED_RADPS = math.radians(0.05)


class Twist(Struct, frozen=True):
    """Velocity in ``base_link``: m/s forward positive, rad/s counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0

    @property
    def is_zero(self) -> bool:
        """Tell whether it asks for no motion at all."""
        return self.linear == 0 and self.angular == 0

    @property
    def rounds_to_zero(self) -> bool:
        """Return whether the motion frame for it commands zero."""
        return abs(self.linear) <= ROUNDED_MPS and abs(self.angular) <= ROUNDED_RADPS

    @property
    def is_standing(self) -> bool:
        """Tell whether it counts as standstill when measured."""
        return abs(self.linear) < STANDING_MPS and abs(self.angular) < STANDING_RADPS

    def scaled(self, factor: float) -> "Twist":
        """Return it slower or faster on the same curve."""
        return Twist(self.linear * factor, self.angular * factor)

    def within(self, linear: float, angular: float) -> "Twist":
        """Return it slowed, on the same curve, to at most these magnitudes (m/s, rad/s)."""
        over = max(abs(self.linear) / linear, abs(self.angular) / angular, 1.0)
        return self.scaled(1 / over)


STILL = Twist()
