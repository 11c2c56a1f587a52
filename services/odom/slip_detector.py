"""Slip detection: compares counters with velocities over the last second.

The same history gives the twist by the counters alone.
"""

import math
from collections import deque

from msgspec import Struct

from common.freshness import NS_PER_S
from services.odom.config import Odom
from services.odom.pose import ArcSegment

COMPARED_NS = NS_PER_S  # comparison window
TWIST_NS = NS_PER_S // 5  # window of the twist by counters, whose steps are 1 mm and 0.1 deg
TWIST_MIN_S = 0.05
COUNTER_STEP_M = 0.001  # manual 2.3
COUNTER_STEP_RAD = math.radians(0.1)


class TwistEstimate(Struct, frozen=True):
    """A velocity in ``base_link``, m/s and rad/s, with its two variances."""

    linear: float
    angular: float
    linear_variance: float
    angular_variance: float


class Entry(Struct, frozen=True):
    """The motion between two counter samples: counted, and integrated from velocities."""

    end_ns: int
    counted: ArcSegment
    integrated: ArcSegment
    comparable: bool


class SlipDetector:
    """Slip flag and residual over the last second of counter samples."""

    def __init__(self, settings: Odom) -> None:
        self.residual: float | None = None  # m, counters minus velocities
        self.slip = False
        self._settings = settings
        self._entries: deque[Entry] = deque()
        self._seen = True

    def clear(self) -> None:
        """Drop the history: the counters restarted."""
        self._entries.clear()

    def add(self, end_ns: int, counted: ArcSegment, integrated: ArcSegment) -> None:
        """Add the motion up to a new counter sample."""
        comparable = integrated.seen and self._seen
        self._entries.append(Entry(end_ns, counted, integrated, comparable))
        self._seen = integrated.seen

    def update(self, now_ns: int) -> None:
        """Compare the entries of the last second; set ``slip`` and ``residual``.

        Entries without velocities are left out, and so is the entry after such a gap: after a
        stall of this process its counters may have been measured before the gap. The slip flag
        is set above a limit and cleared below half of it.
        """
        while self._entries and now_ns - self._entries[0].end_ns > COMPARED_NS:
            self._entries.popleft()
        compared = [entry for entry in self._entries if entry.comparable]
        distance = sum(entry.counted.distance - entry.integrated.distance for entry in compared)
        turn = sum(entry.counted.turn - entry.integrated.turn for entry in compared)
        slack = 0.5 if self.slip else 1.0
        limits = self._settings.slip_distance * slack, self._settings.slip_turn * slack
        self.slip = abs(distance) > limits[0] or abs(turn) > limits[1]
        self.residual = distance if compared else None

    def twist(self, now_ns: int) -> TwistEstimate | None:
        """Return the velocity by the counters; None with too few samples."""
        recent = [e.counted for e in self._entries if now_ns - e.end_ns <= TWIST_NS]
        time_s = sum(segment.time_s for segment in recent)
        if time_s < TWIST_MIN_S:
            return None
        return TwistEstimate(
            sum(segment.distance for segment in recent) / time_s,
            sum(segment.turn for segment in recent) / time_s,
            (COUNTER_STEP_M / time_s) ** 2,
            (COUNTER_STEP_RAD / time_s) ** 2,
        )
