"""Bounded process noise while the vehicle stands.

Counters that dither by one step and velocities slightly off zero are not travel. Without
a bound the noise of each tiny arc adds up for as long as the vehicle stands.
"""

import math
from collections.abc import Sequence

from msgspec.structs import replace

from common.messages import Mileage
from services.odom.config import Odom
from services.odom.pose import ArcSegment
from services.odom.slip_detector import COUNTER_STEP_M, COUNTER_STEP_RAD

DISTANCE_WRAP_M = 2**32 / 1000  # the counter is an s32 of millimetres
WINDOW = 1.5  # counter steps around the reference: one step, and rounding


class Standstill:
    """Standstill detection by counters and velocities; one counter step of noise for each."""

    def __init__(self, settings: Odom) -> None:
        self._settings = settings
        self._reference: Mileage | None = None  # counters when the standstill began
        self._left: tuple[float, float] | None = None  # m and rad of noise; None while moving

    def update(self, counters: Mileage, segments: Sequence[ArcSegment]) -> None:
        """Process counters and the arc segments since the last ones."""
        if not (self._is_near(counters) and self._is_quiet(segments)):
            self._reference = counters
            self._left = None
        elif self._left is None:
            self._left = COUNTER_STEP_M, COUNTER_STEP_RAD

    def noise_part(self, segment: ArcSegment) -> ArcSegment:
        """Return the part of an arc that adds noise; at standstill one counter step in total."""
        if self._left is None:
            return segment
        distance = min(abs(segment.distance), self._left[0])
        turn = min(abs(segment.turn), self._left[1])
        self._left = self._left[0] - distance, self._left[1] - turn
        return replace(segment, distance=distance, turn=turn)

    def _is_near(self, counters: Mileage) -> bool:
        """Return whether the counters are at the reference, across wraps."""
        if self._reference is None:
            return False
        distance = math.remainder(counters.distance - self._reference.distance, DISTANCE_WRAP_M)
        turn = math.remainder(counters.heading - self._reference.heading, math.tau)
        return abs(distance) < WINDOW * COUNTER_STEP_M and abs(turn) < WINDOW * COUNTER_STEP_RAD

    def _is_quiet(self, segments: Sequence[ArcSegment]) -> bool:
        """Return whether the velocities show no more than a counter step and their noise.

        Motion back and forth between two counter samples is not visible in the counters.
        """
        time_s = sum(segment.time_s for segment in segments)
        distance = sum(abs(segment.distance) for segment in segments)
        turn = sum(abs(segment.turn) for segment in segments)
        return (
            distance <= COUNTER_STEP_M + self._settings.velocity_noise * time_s
            and turn <= COUNTER_STEP_RAD + self._settings.angular_noise * time_s
        )
