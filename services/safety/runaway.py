"""Runaway detection: compares measured with commanded motion, separately for each axis.

After a slower command the vehicle needs time to slow down. So each direction has an *envelope*: it
rises with the command at once, and falls at the guaranteed deceleration.

A sample is bad when it exceeds the envelope by the tolerance, or when it moves against a command
whose opposite envelope is zero. Bad time adds up; good time subtracts at half the rate, so
alternating samples trip too.
"""

from msgspec import Struct

GOOD_PER_BAD = 0.5  # a good second subtracts half a bad second


class Bounds(Struct, frozen=True):
    """Limits of one axis, in m and s or rad and s."""

    deceleration: float  # guaranteed
    tolerance: float  # over the envelope
    against: float  # speed against the command, above noise
    patience_s: float  # bad time that trips


class Axis(Struct, frozen=True):
    """State of one axis: envelopes as magnitudes, and the accumulated bad time."""

    ahead: float = 0.0
    back: float = 0.0
    bad_s: float = 0.0

    def follow(self, commanded: float, measured: float, dt_s: float, bounds: Bounds) -> "Axis":
        """Return the axis ``dt_s`` seconds later."""
        fall = bounds.deceleration * dt_s
        ahead = max(commanded, self.ahead - fall, 0.0)
        back = max(-commanded, self.back - fall, 0.0)
        bad = (
            measured > ahead + bounds.tolerance
            or -measured > back + bounds.tolerance
            or (commanded < 0 and ahead == 0 and measured > bounds.against)
            or (commanded > 0 and back == 0 and -measured > bounds.against)
        )
        bad_s = self.bad_s + (dt_s if bad else -dt_s * GOOD_PER_BAD)
        # Capped at the limit, so that the cause clears as soon as the vehicle obeys again.
        return Axis(ahead, back, min(max(0.0, bad_s), bounds.patience_s))
