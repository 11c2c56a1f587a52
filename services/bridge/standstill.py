"""Standstill supervision by the bridge while no safety service commands.

STOP coasts, and the board may not obey it. From the moment the motion lease is over:

=========== ==================================== ===================================================
phase       ends with                            BRAKE
=========== ==================================== ===================================================
stopping    a velocity that counts as standstill not standing after v / a + 0.5 s, or after the
                                                 coast limit if that is sooner
standing    a living lease                       0.05 m or 0.05 rad away from where it stood, by the
                                                 board's counters or by its velocities
=========== ==================================== ===================================================

The first BRAKE lasts until the vehicle stands, the second one until safety has latched it (see
``lease``). The way is measured by the rules of
safety's supervision, so that it does not trip by noise or drift:

- of two velocities in a row the smaller counts, and none below the standstill threshold: a sensor's
  offset is no motion, and the counters find a slow creep
- the integral of the velocities leaks
- the heading counter may drift, as gyroscopes do
"""

import math

from msgspec import Struct

from common.freshness import NS_PER_S
from common.messages import Mileage, Velocity
from common.motion import STANDING_MPS, STANDING_RADPS, is_standing

SLACK_S = 0.5
AWAY_M, AWAY_RAD = 0.05, 0.05
LEAK_S = 5.0  # time constant of the integrated velocities
DRIFT_RADPS = 0.001  # of the heading counter


class Travel(Struct):
    """How far the vehicle moved since it stood, in m and rad."""

    moved: float = 0.0  # by the velocities
    turned: float = 0.0
    counted_m: float = 0.0  # by the counters
    counted_rad: float = 0.0
    mileage: tuple[Mileage, int] | None = None  # the newest one, and when it came


class Standstill:
    """Follows the vehicle from the end of a lease on."""

    def __init__(
        self, deceleration: float, angular_deceleration: float, coast_ns: int, silence_ns: int
    ) -> None:
        """Take m/s^2 and rad/s^2 that a STOP reaches, and how long a velocity sample holds."""
        self._deceleration = deceleration
        self._angular_deceleration = angular_deceleration
        self._coast_ns = coast_ns
        self._silence_ns = silence_ns
        self._velocity: tuple[Velocity, int] | None = None
        self._begin(None)

    def _begin(self, over_since_ns: int | None) -> None:
        self._since_ns = over_since_ns
        self.limit_ns = self._coast_ns  # from the end of the lease until it must stand
        self.left = False  # whether it moved away from where it stood
        self._travel: Travel | None = None  # None while it has not stood

    def on_lease(self, over_since_ns: int | None) -> None:
        """Take in since when the lease is over; None while it lives."""
        if over_since_ns == self._since_ns:
            return
        self._begin(over_since_ns)
        if over_since_ns is not None and self._velocity is not None:
            velocity, measured_ns = self._velocity
            if over_since_ns - measured_ns <= self._silence_ns:
                self.limit_ns = min(self._coast_ns, self._stopping_ns(velocity))

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Take in what the board measured."""
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
        travel.moved = travel.moved * kept + linear * elapsed_s
        travel.turned = travel.turned * kept + angular * elapsed_s
        self._judge(travel.moved, travel.turned)

    def on_mileage(self, mileage: Mileage, now_ns: int) -> None:
        """Take in what the board counted."""
        travel = self._travel
        if travel is None:
            return
        before, travel.mileage = travel.mileage, (mileage, now_ns)
        if before is None or before[0].epoch != mileage.epoch:
            return
        travel.counted_m += mileage.distance - before[0].distance
        turned = travel.counted_rad + math.remainder(mileage.heading - before[0].heading, math.tau)
        drift = DRIFT_RADPS * (now_ns - before[1]) / NS_PER_S
        travel.counted_rad = math.copysign(max(0.0, abs(turned) - drift), turned)
        self._judge(travel.counted_m, travel.counted_rad)

    def _judge(self, moved: float, turned: float) -> None:
        self.left = self.left or abs(moved) >= AWAY_M or abs(turned) >= AWAY_RAD

    def _stopping_ns(self, velocity: Velocity) -> int:
        linear_s = abs(velocity.linear) / self._deceleration
        angular_s = abs(velocity.angular) / self._angular_deceleration
        return round((max(linear_s, angular_s) + SLACK_S) * NS_PER_S)


def _steady(before: float, after: float, threshold: float) -> float:
    """Return what two velocities agree on, 0 if that is under the threshold."""
    if before * after <= 0:
        return 0.0
    steady = min(before, after, key=abs)
    return steady if abs(steady) >= threshold else 0.0
