"""The way that the robot went, thinned by distance and bounded: the newest points stay."""

import math
from collections import deque
from dataclasses import dataclass, field

SPACING_M = 0.05
POINTS = 4000


@dataclass
class Trail:
    """Points in ``odom``, metres; begins anew with each epoch of odometry."""

    points: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=POINTS))
    epoch: int | None = None

    def add(self, x: float, y: float, epoch: int) -> bool:
        """Keep a point if it is far enough from the last one; tell whether all began anew."""
        anew = self.epoch is not None and epoch != self.epoch
        if anew:
            self.points.clear()
        self.epoch = epoch
        if not self.points or math.dist(self.points[-1], (x, y)) >= SPACING_M:
            self.points.append((round(x, 3), round(y, 3)))
        return anew

    def begin(self, earlier: list[tuple[float, float]], epoch: int) -> None:
        """Put what odometry remembers in front of what was seen since."""
        if self.epoch in (None, epoch):
            self.epoch = epoch
            since = list(self.points)
            self.points.clear()
            self.points.extend([*earlier, *since])
