"""The line of a route by its length: where a pose is on it, and how far beside it."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise

from msgspec import Struct

from common.pose import Covariance

Point = tuple[float, float]  # m, in ``map``
TIE = 1e-3  # m beside the line for each m along it: prefers the nearer of two lines at one place


class Nearest(Struct, frozen=True):
    """The nearest place of a line to a pose."""

    along: float  # m from the begin of the line
    deviation: float  # m from the line to the pose
    direction: float  # rad, of the line there


class Fit(Struct, frozen=True):
    """How a pose lies in a corridor."""

    nearest: Nearest
    sigma: float  # m, standard deviation across the line
    corridor: float  # m, half width

    @property
    def margin(self) -> float:
        """What is left of the corridor: negative where the vehicle must stop, m."""
        return self.corridor - self.nearest.deviation - 2 * self.sigma


class Track:
    """Straight lines through points; a place on them is a length from the first point."""

    def __init__(self, points: Sequence[Point]) -> None:
        self.points = tuple(points)
        self.at = [0.0]  # m, of each point
        for a, b in pairwise(self.points):
            self.at.append(self.at[-1] + math.dist(a, b))

    @property
    def length(self) -> float:
        """The length of all lines, m."""
        return self.at[-1]

    def point(self, along: float) -> Point:
        """Return the point at this length, or the first or last one."""
        index = min(max(bisect_right(self.at, along), 1), len(self.at) - 1)
        (ax, ay), (bx, by) = self.points[index - 1], self.points[index]
        length = self.at[index] - self.at[index - 1]
        share = min(max((along - self.at[index - 1]) / length, 0.0), 1.0) if length else 0.0
        return ax + (bx - ax) * share, ay + (by - ay) * share

    def nearest(self, x: float, y: float, along: float, window: float) -> Nearest:
        """Return the nearest place to (x, y), m, at most ``window`` m before or after ``along``.

        So a route that crosses itself, or comes back the same way, is no ambiguity.
        """
        first = max(bisect_left(self.at, along - window) - 1, 0)
        last = min(bisect_right(self.at, along + window), len(self.at) - 1)
        lines = [index for index in range(first, last) if self.at[index + 1] > self.at[index]]
        found = (self._on_line(index, x, y, along - window, along + window) for index in lines)
        return min(found, key=lambda each: each.deviation + TIE * abs(each.along - along))

    def _on_line(self, index: int, x: float, y: float, least: float, most: float) -> Nearest:
        (ax, ay), (bx, by) = self.points[index], self.points[index + 1]
        begin, end = self.at[index], self.at[index + 1]
        length = end - begin
        way = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length
        way = min(max(way, 0.0, least - begin), length, max(most - begin, 0.0))
        place = ax + (bx - ax) * way / length, ay + (by - ay) * way / length
        direction = math.atan2(by - ay, bx - ax)
        return Nearest(begin + way, math.dist(place, (x, y)), direction)


def across(covariance: Covariance, direction: float) -> float:
    """Return the standard deviation across a line of this direction, m."""
    return math.sqrt(max(0.0, covariance.rotated(-direction).yy))
