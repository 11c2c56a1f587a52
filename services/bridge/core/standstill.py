"""Standstill supervision by the bridge while no safety service commands.

STOP coasts, and the board may not obey it. From the moment the motion lease is over:

=========== ==================================== ===================================================
phase       ends with                            BRAKE
=========== ==================================== ===================================================
stopping    a velocity that counts as standstill no standstill after v / a + 0.5 s, or after the
                                                 coast limit if that is sooner
standstill  a valid lease                        0.05 m or 0.05 rad away from the stop position, by
                                                 the board's counters or by its velocities
=========== ==================================== ===================================================

The first BRAKE lasts until standstill, the second one until safety has latched it (see ``lease``).
Distances are measured by the rules of safety's supervision, so that noise or drift do not trip it:

- of two consecutive velocities the smaller counts, and none below the standstill threshold: the
  offset of a sensor is no motion, and the counters detect slow creep
- the integral of the velocities leaks
- the heading counter may drift, as gyroscopes do
"""

import math

from msgspec import Struct

from common.freshness import NS_PER_S
from common.messages import Mileage, Velocity
from common.motion import STANDING_MPS, STANDING_RADPS, is_standing
from common.standstill import AWAY_M, AWAY_RAD, DRIFT_RADPS, LEAK_S

SLACK_S = 0.5


class Travel(Struct):
    """Travel since standstill, in m and rad."""

    moved: float = 0.0  # by the velocities
    turned: float = 0.0
    counted_m: float = 0.0  # by the counters
    counted_rad: float = 0.0
    mileage: tuple[Mileage, int] | None = None  # the newest sample and its receive time


class Standstill:
    """Supervises the vehicle from the end of a lease on."""

    def __init__(
        self, deceleration: float, angular_deceleration: float, coast_ns: int, silence_ns: int
    ) -> None:
        """Set up with the deceleration of a STOP (m/s^2, rad/s^2), and time limits."""
        self._deceleration = deceleration
        self._angular_deceleration = angular_deceleration
        self._coast_ns = coast_ns
        self._silence_ns = silence_ns
        self._velocity: tuple[Velocity, int] | None = None
        self._begin(None)

    def _begin(self, over_since_ns: int | None) -> None:
        self._since_ns = over_since_ns
        self.limit_ns = self._coast_ns  # from the end of the lease until standstill is required
        self.moved_away = False  # away from the stop position
        self._travel: Travel | None = None  # None until standstill

    def on_lease(self, over_since_ns: int | None) -> None:
        """Set the end time of the lease; None while it is valid."""
        if over_since_ns == self._since_ns:
            return
        self._begin(over_since_ns)
        if over_since_ns is not None and self._velocity is not None:
            velocity, measured_ns = self._velocity
            if over_since_ns - measured_ns <= self._silence_ns:
                self.limit_ns = min(self._coast_ns, self._stopping_ns(velocity))

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Process a measured velocity."""
        before, self._velocity = self._velocity, (velocity, now_ns)
        if self._since_ns is None:
            return
        travel = self._travel
        if before is None or travel is None:
            self._travel = Travel() if is_standing(velocity.linear, velocity.angular) else None
            return
        elapsed_s = min(now_ns - before[1], self._silence_ns) / NS_PER_S
        kept = 1 - elapsed_s / LEAK_S
        linear = _steady(before[0].linear, velocity.linear, STANDING_MPS)
        angular = _steady(before[0].angular, velocity.angular, STANDING_RADPS)
        # 1 equivalent mutant: only the size of the sum is judged.
        travel.moved = travel.moved * kept + linear * elapsed_s
        # 1 equivalent mutant: only the size of the sum is judged.
        travel.turned = travel.turned * kept + angular * elapsed_s
        self._check(travel.moved, travel.turned)

    def on_mileage(self, mileage: Mileage, now_ns: int) -> None:
        """Process the board's counters."""
        travel = self._travel
        if travel is None:
            return
        before, travel.mileage = travel.mileage, (mileage, now_ns)
        if before is None or before[0].epoch != mileage.epoch:
            return
        # 1 equivalent mutant: only the size of the sum is judged.
        travel.counted_m += mileage.distance - before[0].distance
        # 1 equivalent mutant: only the size of the sum is judged.
        turned = travel.counted_rad + math.remainder(mileage.heading - before[0].heading, math.tau)
        drift = DRIFT_RADPS * (now_ns - before[1]) / NS_PER_S
        travel.counted_rad = math.copysign(max(0.0, abs(turned) - drift), turned)
        self._check(travel.counted_m, travel.counted_rad)

    def _check(self, moved: float, turned: float) -> None:
        self.moved_away = self.moved_away or abs(moved) >= AWAY_M or abs(turned) >= AWAY_RAD

    def _stopping_ns(self, velocity: Velocity) -> int:
        linear_s = abs(velocity.linear) / self._deceleration
        angular_s = abs(velocity.angular) / self._angular_deceleration
        return round((max(linear_s, angular_s) + SLACK_S) * NS_PER_S)


def _steady(before: float, after: float, threshold: float) -> float:
    """Return the smaller of two velocities of one sign; 0 below the threshold."""
    # 1 equivalent mutant: with a product of zero the smaller of the two is zero, too.
    if before * after <= 0:
        return 0.0
    steady = min(before, after, key=abs)
    return steady if abs(steady) >= threshold else 0.0
