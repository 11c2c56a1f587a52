"""Whether the vehicle moves as it was commanded; judged for each axis on its own.

After a slower command the vehicle needs time. So the command is followed by an *envelope* for each
direction: it rises with the command at once, and falls no faster than the vehicle surely slows
down.

Bad is: over the envelope by the tolerance, or moving against a command whose opposite
envelope is used up. Bad time adds up; good time takes away half as fast, so that flapping trips.
"""

from msgspec import Struct

GOOD_PER_BAD = 0.5  # a second of good takes away half a second of bad


class Bounds(Struct, frozen=True):
    """What one axis may do, in m and s or rad and s."""

    deceleration: float  # what the vehicle surely reaches
    tolerance: float  # over the envelope
    against: float  # speed against the command that is more than noise
    patience_s: float  # bad time that trips


class Axis(Struct, frozen=True):
    """One axis: the envelope both ways, as magnitudes, and for how long it has been bad."""

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
        # No more than trips, so that it is gone as soon as the vehicle obeys again.
        return Axis(ahead, back, min(max(0.0, bad_s), bounds.patience_s))
