"""Process noise of arcs: how much less certain the pose is after each.

========================= ====================== =========================== ====================
arc                       length                 turn                        end position
========================= ====================== =========================== ====================
counted                   ``distance_noise``     ``turn_noise``,             none
                                                 ``drift_noise``
counted, over a gap       the same               the same                    ``GAP_NOISE`` by m
by velocities             + ``velocity_noise``   + ``angular_noise``         none
nothing, in a gap         + ``velocity_noise``   + ``angular_noise``,        ``GAP_NOISE`` by s
                                                 ``GAP_TURN_NOISE``
========================= ====================== =========================== ====================

Counters that dither by one step and velocities slightly off zero are not travel: their noise would
add up for as long as the vehicle stands. Each standstill adds the noise of one counter step at
most; a vehicle that creeps leaves its place step by step, and so adds all of it.
"""

import math
from collections.abc import Sequence

from services.odom.config import Odom
from services.odom.core.pose import ArcSegment, ProcessNoise
from t2.messages import Mileage

COUNTER_STEP_M = 0.001  # manual 2.3
COUNTER_STEP_RAD = math.radians(0.1)
HOLD_S = 0.1  # that a velocity is valid: five reports
# Of the place (m): per sqrt(m) driven in a gap, per sqrt(s) while it lasts. Of the turn (rad): per
# sqrt(s) while it lasts.
GAP_NOISE, GAP_TURN_NOISE = 0.2, 0.3
WINDOW = 1.5  # counter steps around the place of a standstill: one step, and rounding


class NoiseModel:
    """Process noise by the settings, and whether the vehicle stands."""

    def __init__(self, settings: Odom) -> None:
        self._settings = settings
        self._place: Mileage | None = None  # counters when the vehicle last moved
        self._left: tuple[float, float] | None = None  # m and rad to count; None while moving

    def counted(self, segment: ArcSegment) -> ProcessNoise:
        """Return the noise of a counted arc: its end is measured, its shape in a gap is not."""
        length, turn = abs(segment.distance), abs(segment.turn)
        if self._left is not None:
            length, turn = min(length, self._left[0]), min(turn, self._left[1])
            self._left = self._left[0] - length, self._left[1] - turn
        gap_m = length if self._gap_s(segment) else 0.0
        return ProcessNoise(*self._travel(length, turn), GAP_NOISE**2 * gap_m)

    def extrapolated(self, segment: ArcSegment) -> ProcessNoise:
        """Return the noise of an arc that only velocities measured, or nothing."""
        of, gap_s = self._settings, self._gap_s(segment)
        length, turn = self._travel(abs(segment.distance), abs(segment.turn))
        return ProcessNoise(
            length + of.velocity_noise**2 * segment.time_s,
            turn + of.angular_noise**2 * segment.time_s + GAP_TURN_NOISE**2 * gap_s,
            GAP_NOISE**2 * gap_s,
        )

    def update(self, counters: Mileage, segments: Sequence[ArcSegment]) -> None:
        """Process counters and the arcs of the velocities since the last ones."""
        if not (self._is_near(counters) and self._is_quiet(segments)):
            self._place, self._left = counters, None
        elif self._left is None:
            self._left = COUNTER_STEP_M, COUNTER_STEP_RAD

    def _is_near(self, counters: Mileage) -> bool:
        if self._place is None:
            return False
        distance = counters.distance - self._place.distance
        turn = math.remainder(counters.heading - self._place.heading, math.tau)
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

    def _travel(self, length: float, turn: float) -> tuple[float, float]:
        """Return the variances of length and turn after this way."""
        of = self._settings
        return of.distance_noise**2 * length, of.turn_noise**2 * turn + of.drift_noise**2 * length

    def _gap_s(self, segment: ArcSegment) -> float:
        return 0.0 if segment.seen else max(0.0, segment.time_s - HOLD_S)
