"""Standstill: whether the vehicle stands, and how far it has left the place where it stood.

The distance from that place is measured twice. The board's counters show a slow creep. The
velocities show a fast motion, even while the counters are not answered. Neither may trip by noise,
drift or a restart of the board:

- of two consecutive velocities the smaller counts, and none below the standstill threshold
- the integral of the velocities leaks
- readings of the counters from before a restart are not compared with later ones
- the heading counter may drift like a gyroscope
"""

import math

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import STANDING_MPS, STANDING_RADPS, STILL, Twist
from t2.messages import Mileage

AWAY_M, AWAY_RAD = 0.05, 0.05  # from the place of the standstill
LEAK_S = 5.0  # time constant of the integrated velocities
DRIFT_RADPS = 0.001  # of the heading counter
LONGEST_GAP_S = 0.1  # between two velocities; over longer gaps the motion is unknown
GRACE_NS = NS_PER_S // 2  # of a stop, on top of v / a


class Displacement(Struct, frozen=True):
    """Newest measured motion, and the displacement from a place since then (m and rad)."""

    velocity: Latest[Twist] | None = None  # the newest; None while unknown
    steady: Twist | None = None  # the common part of the last two velocities
    mileage: Latest[Mileage] | None = None  # the newest counters
    integrated: Twist = STILL  # from the velocities
    counted: Twist = STILL  # from the counters

    @property
    def is_standing(self) -> bool:
        """Whether the vehicle is known to be at standstill."""
        return self.steady is not None and self.steady.is_standing

    @property
    def has_left(self) -> bool:
        """Whether the vehicle has left the place."""
        return any(
            abs(way.linear) > AWAY_M or abs(way.angular) > AWAY_RAD
            for way in (self.integrated, self.counted)
        )

    def from_here(self) -> "Displacement":
        """Return the displacement from the present place."""
        return replace(self, integrated=STILL, counted=STILL)

    def with_velocity(self, newest: Latest[Twist] | None) -> "Displacement":
        """Return the displacement after a velocity; each counts once, None is unknown."""
        before = self.velocity
        if newest is None or before is None:
            return replace(self, velocity=newest, steady=newest.value if newest else None)
        if newest.received_ns == before.received_ns:
            return self
        steady = _steady(before.value, newest.value)
        gap_s = min((newest.received_ns - before.received_ns) / NS_PER_S, LONGEST_GAP_S)
        kept = 1 - gap_s / LEAK_S
        way = self.integrated
        integrated = Twist(
            way.linear * kept + _over(steady.linear, STANDING_MPS) * gap_s,
            way.angular * kept + _over(steady.angular, STANDING_RADPS) * gap_s,
        )
        return replace(self, velocity=newest, steady=steady, integrated=integrated)

    def with_mileage(self, newest: Latest[Mileage] | None) -> "Displacement":
        """Return the displacement after a reading of the counters; each counts once."""
        before = self.mileage
        if newest is None or (before is not None and newest.received_ns == before.received_ns):
            return self
        if before is None or not comparable(before.value, newest.value):
            return replace(self, mileage=newest)
        step = newest.value.distance - before.value.distance
        turn = math.remainder(newest.value.heading - before.value.heading, math.tau)
        turned = self.counted.angular + turn
        drift = DRIFT_RADPS * (newest.received_ns - before.received_ns) / NS_PER_S
        counted = Twist(
            self.counted.linear + step, math.copysign(max(0.0, abs(turned) - drift), turned)
        )
        return replace(self, mileage=newest, counted=counted)


def comparable(before: Mileage, after: Mileage) -> bool:
    """Return whether neither the bridge nor the counters started again between two readings."""
    return (before.boot, before.epoch) == (after.boot, after.epoch)


def stopping_s(velocity: Twist, deceleration: float, angular_deceleration: float) -> float:
    """Return the time (s) from slowing down to standstill.

    A vehicle in a curve slows down on both axes together, so the longer of the two times counts.
    """
    return max(abs(velocity.linear) / deceleration, abs(velocity.angular) / angular_deceleration)


def stopping_ns(velocity: Twist, deceleration: float, angular_deceleration: float) -> int:
    """Return the time until the vehicle must stand after a stop: v / a and the grace."""
    return round(stopping_s(velocity, deceleration, angular_deceleration) * NS_PER_S) + GRACE_NS


def _steady(before: Twist, after: Twist) -> Twist:
    """Return the common part of two velocities, so that a single wrong one does not count."""
    return Twist(_common(before.linear, after.linear), _common(before.angular, after.angular))


def _common(one: float, other: float) -> float:
    return 0.0 if one * other <= 0 else min(one, other, key=abs)


def _over(value: float, threshold: float) -> float:
    return value if abs(value) >= threshold else 0.0
