"""Trajectory: signed travel over the last metre by the board's counter, and its direction.

It informs the operator which way off a pressed bumper is believed free, and why. It decides
nothing.

One velocity sample is not evidence of a direction, because a vehicle rebounds from a hit. The
counter is read in steps larger than its noise, and a short run in the other direction does not
change the result. A turn on the spot and a restart of the board or the bridge discard earlier
travel.
"""

import math

from msgspec import Struct

from common.freshness import Latest
from common.messages import Direction, Mileage
from common.standstill import comparable
from services.safety.core.causes import Held

REACH_M = 1.0  # of travel is stored
STEP_M = 0.005  # smaller changes are resolution or noise of the counter
RUN_M = 0.05  # shorter runs may be a rebound
TURN_RAD = 0.35  # a larger turn on the spot invalidates earlier travel

OPPOSITE: dict[Direction, Direction] = {"forward": "backward", "backward": "forward"}


class Trajectory(Struct, frozen=True):
    """The last metre as runs, each of one sign."""

    runs: tuple[float, ...] = ()  # m, forward positive, the oldest first
    at: Mileage | None = None  # end of the last run
    ended_ns: int | None = None  # time of that

    def follow(self, counters: Latest[Mileage]) -> "Trajectory":
        """Return the trajectory after a reading of the counters."""
        reading = counters.value
        if self.at is None or not comparable(self.at, reading):
            return Trajectory(at=reading)
        run = reading.distance - self.at.distance
        if abs(run) >= STEP_M:
            return Trajectory(_joined(self.runs, run), reading, counters.received_ns)
        turned = math.remainder(reading.heading - self.at.heading, math.tau)
        return Trajectory(at=reading) if abs(turned) > TURN_RAD else self

    @property
    def net(self) -> float:
        """The sum of all runs in metres, forward positive."""
        return sum(self.runs)

    @property
    def direction(self) -> Direction | None:
        """Direction of travel; None unless net travel and the last longer run agree."""
        last = next((run for run in reversed(self.runs) if abs(run) >= RUN_M), 0.0)
        if last * self.net <= 0:
            return None
        return "forward" if last > 0 else "backward"


class Approach(Struct, frozen=True):
    """The trajectory now, and the one before the newest contact."""

    now: Trajectory = Trajectory()
    before: Trajectory = Trajectory()
    contact: int | None = None  # identity of that contact

    def follow(self, counters: Latest[Mileage] | None, contact: Held | None) -> "Approach":
        """Return the approach after a decision on these counters; ``contact`` as held now."""
        now = self.now.follow(counters) if counters else self.now
        if contact is None or contact.id == self.contact:
            return Approach(now, self.before, self.contact)
        return Approach(now, now, contact.id)


def _joined(runs: tuple[float, ...], run: float) -> tuple[float, ...]:
    """Return the runs with one more, cut to the reach."""
    if runs and math.copysign(run, runs[-1]) == run:
        run += runs[-1]
        runs = runs[:-1]
    runs = (*runs, run)
    over = max(0.0, sum(map(abs, runs)) - REACH_M)
    while over >= abs(runs[0]):
        over -= abs(runs[0])
        runs = runs[1:]
    return (math.copysign(abs(runs[0]) - over, runs[0]), *runs[1:])
