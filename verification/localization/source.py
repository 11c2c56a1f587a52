"""A simulated source of fixes: it measures the truth with noise, a delay, outliers and gaps."""

import math
import random
from collections import deque
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from t2 import keys
from t2 import messages as m
from verification.search.bus import ROBOT
from verification.search.stack import Stack

OUTLIER_M = 5.0  # standard deviation
SOURCE = "tags"
CYCLE = 300  # ticks: the first ones of each cycle are the gap


class FixModel(Struct, frozen=True, kw_only=True):
    """How a simulated source measures the truth. A tick is 100 ms."""

    period: int  # ticks between two fixes
    sigma: float  # m
    heading_sigma: float | None  # rad; None: it measures no heading
    delay: int  # ticks
    outliers: float  # share
    gap: int  # ticks without fixes, of each cycle


class FixSource:
    """Measures a vehicle, and publishes fixes of it."""

    def __init__(self, model: FixModel, stack: Stack, chance: random.Random) -> None:
        self._model, self._stack, self._random = model, stack, chance
        self._odometry: m.Odometry | None = None
        self._waiting: deque[tuple[int, m.Fix]] = deque()
        stack.hand.subscribe(keys.ODOMETRY, self._on_odometry)

    def _on_odometry(self, arrival: Any) -> None:
        self._odometry = arrival.message

    def measure(self, tick: int) -> None:
        """Measure the truth at the newest odometry, and deliver what is due."""
        of = self._model
        if tick % of.period == 0 and tick % CYCLE >= of.gap and self._odometry is not None:
            self._waiting.append((tick + of.delay, self._fix(self._odometry)))
        while self._waiting and self._waiting[0][0] <= tick:
            fix = replace(self._waiting.popleft()[1], boot=1, seq=tick)
            self._stack.hand.post(keys.FIX.on(ROBOT, source=SOURCE), fix)

    def _fix(self, odometry: m.Odometry) -> m.Fix:
        of, noise, truth = self._model, self._random.gauss, self._stack.vehicle.simulation.pose
        away = OUTLIER_M if self._random.random() < of.outliers else 0.0
        turned = of.heading_sigma
        return m.Fix(
            x=truth.x + noise(0.0, of.sigma) + noise(0.0, away),
            y=truth.y + noise(0.0, of.sigma) + noise(0.0, away),
            heading=None if turned is None else truth.heading + noise(0.0, turned),
            covariance=(of.sigma**2, 0, 0, 0, of.sigma**2, 0, 0, 0, (turned or 1.0) ** 2),
            odom_boot=odometry.boot,
            odom_seq=odometry.seq,
        )


def place_request(stack: Stack, chance: random.Random, sigma: float) -> m.PlaceRequest:
    """Return a placement as a person makes it, a little beside the truth."""
    truth, noise = stack.vehicle.simulation.pose, chance.gauss
    assert stack.seen is not None
    return m.PlaceRequest(
        x=truth.x + noise(0.0, sigma),
        y=truth.y + noise(0.0, sigma),
        heading=math.remainder(truth.heading + noise(0.0, sigma), math.tau),
        sigma=sigma,
        heading_sigma=sigma,
        echo=stack.seen.heartbeat,
    )
