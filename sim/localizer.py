"""A localizer of the simulated vehicle: measures its true pose, and sends it as fixes.

It stands for tags, GNSS or a lidar: with a rate, noise, delay, outliers and gaps. The map of these
fixes is the simulated world.
"""

import random
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from common import clock
from common.bus.bus import Arrival, Bus
from common.freshness import NS_PER_S
from sim.config import Sim
from sim.trace import Truth
from t2 import keys
from t2 import messages as m

GAP_PERIOD_S = 60.0  # one gap in each
OUTLIER_M = 3.0  # standard deviation of a wrong fix, on top


class Taken(NamedTuple):
    """A fix that is on its way."""

    due_ns: int
    fix: m.Fix


class Localizer:
    """Measures and sends; ``step`` is called with each step of the simulation."""

    def __init__(self, bus: Bus, settings: Sim, truth: Callable[[int], Truth]) -> None:
        self._settings = settings
        self._truth = truth
        self._random = random.Random(settings.seed)
        self._odometry: m.Odometry | None = None
        self._taken: deque[Taken] = deque()
        self._next_ns = clock.now_ns()
        self._to_fix = bus.publisher(keys.FIX, source=settings.fix_source)
        bus.subscribe(keys.ODOMETRY, self._on_odometry)

    def step(self, now_ns: int) -> None:
        """Measure and send what is due."""
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + round(NS_PER_S / self._settings.fix_rate)
            if self._odometry is not None and not self._is_gap(now_ns):
                self._taken.append(self._measure(now_ns, self._odometry))
        while self._taken and now_ns >= self._taken[0].due_ns:
            self._to_fix.put(self._taken.popleft().fix)

    def _on_odometry(self, arrival: Arrival[m.Odometry]) -> None:
        self._odometry = arrival.message

    def _is_gap(self, now_ns: int) -> bool:
        return now_ns / NS_PER_S % GAP_PERIOD_S < self._settings.fix_gap

    def _measure(self, now_ns: int, odometry: m.Odometry) -> Taken:
        of, true, gauss = self._settings, self._truth(now_ns), self._random.gauss
        is_wrong = self._random.random() < of.fix_outliers
        spread = of.fix_sigma + (OUTLIER_M if is_wrong else 0.0)
        place, heading = of.fix_sigma**2, of.fix_heading_sigma**2
        fix = m.Fix(
            x=true.x + gauss(0.0, spread),
            y=true.y + gauss(0.0, spread),
            heading=true.heading + gauss(0.0, of.fix_heading_sigma),
            covariance=(place, 0.0, 0.0, 0.0, place, 0.0, 0.0, 0.0, heading),
            odom_boot=odometry.boot,
            odom_seq=odometry.seq,
        )
        return Taken(now_ns + round(of.fix_delay * NS_PER_S), fix)
