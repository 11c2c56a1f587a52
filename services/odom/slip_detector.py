"""The last second of the counters: against the velocities, and as a velocity themselves."""

import math
from collections import deque

from msgspec import Struct

from common.freshness import NS_PER_S
from services.odom.arc_segments import Leg
from services.odom.config import Odom

COMPARED_NS = NS_PER_S  # how far back counters and velocities are compared
TWIST_NS = (
    NS_PER_S // 5
)  # how far back the counters make a velocity: 1 mm and 0.1 deg are coarse steps
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
    """The way between two counter samples, as counted and as the velocities had it."""

    end_ns: int
    counted: Leg
    integrated: Leg
    comparable: bool


class Comparison:
    """Remembers the last second between counter samples; starts anew when the counters do."""

    def __init__(self, settings: Odom) -> None:
        self.residual: float | None = None  # m that the counters went farther than the velocities
        self.slip = False
        self._settings = settings
        self._entries: deque[Entry] = deque()
        self._seen = True

    def clear(self) -> None:
        """Forget all, because the counters started anew."""
        self._entries.clear()

    def add(self, end_ns: int, counted: Leg, integrated: Leg) -> None:
        """Take the way to a new counter sample."""
        comparable = integrated.seen and self._seen
        self._entries.append(Entry(end_ns, counted, integrated, comparable))
        self._seen = integrated.seen

    def look_back(self, now_ns: int) -> None:
        """Compare what is at most a second old.

        What no velocity saw cannot be compared and is left out, and so is the way after it: where a
        process was held up, the first counters behind the gap may be from before it. The slip flag
        rises over a limit and falls under half of it.
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
        """Return the velocity that the counters make, if they came often enough."""
        recent = [e.counted for e in self._entries if now_ns - e.end_ns <= TWIST_NS]
        time_s = sum(leg.time_s for leg in recent)
        if time_s < TWIST_MIN_S:
            return None
        return TwistEstimate(
            sum(leg.distance for leg in recent) / time_s,
            sum(leg.turn for leg in recent) / time_s,
            (COUNTER_STEP_M / time_s) ** 2,
            (COUNTER_STEP_RAD / time_s) ** 2,
        )
