"""The trajectory, thinned by distance and bounded: the newest points stay."""

import math
from collections import deque

from services.odom.pose import Pose


class Path:
    """Keeps a point for each ``spacing`` metres of way, at most ``points`` of them."""

    def __init__(self, spacing: float, points: int) -> None:
        self.spacing = spacing
        self._points: deque[Pose] = deque(maxlen=points)

    def add(self, pose: Pose) -> None:
        """Keep the pose, if it is far enough from the last one that was kept."""
        last = self._points[-1] if self._points else None
        if last is None or math.hypot(pose.x - last.x, pose.y - last.y) >= self.spacing:
            self._points.append(pose)

    def clear(self) -> None:
        """Begin anew."""
        self._points.clear()

    def points(self) -> list[tuple[float, float, float]]:
        """Return x, y (m) and heading (rad) of each point in ``odom``, the oldest first."""
        return [(point.x, point.y, point.heading) for point in self._points]
