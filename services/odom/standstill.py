"""Bounded process noise while the vehicle stands.

Counters that dither by one step and velocities slightly off zero are not travel. Without
a bound the noise of each tiny arc adds up for as long as the vehicle stands.
"""

import math
from collections.abc import Sequence

from msgspec.structs import replace

from common.messages import Mileage
from services.odom.arc_segments import Leg
from services.odom.config import Odom
from services.odom.slip_detector import COUNTER_STEP_M, COUNTER_STEP_RAD

DISTANCE_WRAP_M = 2**32 / 1000  # the counter is an s32 of millimetres
WINDOW = 1.5  # counter steps around where the counters stood: one step, and rounding


class Standstill:
    """Standstill detection by counters and velocities; one counter step of noise for each."""

    def __init__(self, settings: Odom) -> None:
        self._settings = settings
        self._reference: Mileage | None = None  # where the counters stood
        self._left: tuple[float, float] | None = None  # m and rad of noise; None while moving

    def update(self, counters: Mileage, legs: Sequence[Leg]) -> None:
        """Take counters and what the velocities saw since the last ones."""
        if not (self._near(counters) and self._quiet(legs)):
            self._reference = counters
            self._left = None
        elif self._left is None:
            self._left = COUNTER_STEP_M, COUNTER_STEP_RAD

    def noisy(self, leg: Leg) -> Leg:
        """Return the part of a counted arc that adds noise: all, or what the standstill left."""
        if self._left is None:
            return leg
        distance, turn = min(abs(leg.distance), self._left[0]), min(abs(leg.turn), self._left[1])
        self._left = self._left[0] - distance, self._left[1] - turn
        return replace(leg, distance=distance, turn=turn)

    def _near(self, counters: Mileage) -> bool:
        """Return whether the counters are where they stood, across wraps."""
        if self._reference is None:
            return False
        distance = math.remainder(counters.distance - self._reference.distance, DISTANCE_WRAP_M)
        turn = math.remainder(counters.heading - self._reference.heading, math.tau)
        return abs(distance) < WINDOW * COUNTER_STEP_M and abs(turn) < WINDOW * COUNTER_STEP_RAD

    def _quiet(self, legs: Sequence[Leg]) -> bool:
        """Return whether the velocities show no more than a counter step and their noise.

        Motion forth and back between two counter samples is travel that the counters do not show.
        """
        time_s = sum(leg.time_s for leg in legs)
        distance = sum(abs(leg.distance) for leg in legs)
        turn = sum(abs(leg.turn) for leg in legs)
        return (
            distance <= COUNTER_STEP_M + self._settings.velocity_noise * time_s
            and turn <= COUNTER_STEP_RAD + self._settings.angular_noise * time_s
        )
