"""A route in one of its two directions, and where a round stops on it.

Out, a round stops at each station and before each sharp corner, where the vehicle turns on the
spot. Home, in the opposite direction, it passes the stations.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

from msgspec import Struct

from common.pose import Covariance, Pose
from services.patrol.core.track import Fit, Point, Track, across
from t2 import messages as m
from t2.motion import FACING

CLOSED = 0.1  # m between the ends of a route: a round ends where it began
PASSED = 1.0  # m behind the vehicle: it does not drive back to this station


class Stop(Struct, frozen=True):
    """A point at which the vehicle stops."""

    index: int  # of the point
    station: str = ""  # empty at a corner
    stay: float = 0.0  # s


class Way:
    """A route in the direction of travel."""

    def __init__(self, route: m.Route, *, homeward: bool = False) -> None:
        self.homeward = homeward
        points = route.points[::-1] if homeward else route.points
        self.track = Track([(each.x, each.y) for each in points])
        self._corridor = route.corridor
        corners = {*_sharp(self.track.points), len(points) - 1}
        self.stops = [
            Stop(index, *_station(each, homeward=homeward))
            for index, each in enumerate(points)
            if index and (index in corners or (each.station and not homeward))
        ]
        self.home = route.points[0].station
        a, b = self.track.points[0], self.track.points[-1]
        self.is_closed = math.dist(a, b) <= CLOSED

    def progress(self, along: float) -> float:
        """Return the length along the route from home, m."""
        return self.track.length - along if self.homeward else along

    def fit(self, pose: Pose, covariance: Covariance, along: float, window: float) -> Fit:
        """Return how a pose lies in the corridor near a place of this way."""
        nearest = self.track.nearest(pose.x, pose.y, along, window)
        return Fit(nearest, across(covariance, nearest.direction), self._corridor)

    def next_stop(self, stop: int, along: float) -> int:
        """Return which stop is ahead: a station not visited and not passed, or a corner."""
        for number in range(stop, len(self.stops)):
            each = self.stops[number]
            behind = PASSED if each.station else 0.0
            if self.track.at[each.index] > along - behind:
                return number
        return len(self.stops) - 1

    def points_to(self, stop: int, along: float, ahead: float) -> list[Point]:
        """Return the points from a place to a stop; the first one is ``ahead`` m on the way."""
        end = self.stops[stop].index
        at = self.track.at
        begin = along + ahead
        first = [self.track.point(begin)] if begin < at[end] else []
        between = [self.track.points[i] for i in range(end) if begin < at[i] < at[end]]
        return [*first, *between, self.track.points[end]]

    def at_stop(self, stop: int) -> float:
        """Return the length at which a stop is, m."""
        return self.track.at[self.stops[stop].index]


def _station(point: m.RoutePoint, *, homeward: bool) -> tuple[str, float]:
    return ("", 0.0) if homeward else (point.station, point.stay)


def _sharp(points: Sequence[Point]) -> set[int]:
    """Return the points at which the vehicle turns on the spot."""
    found, before = set[int](), None
    for index, ((ax, ay), (bx, by)) in enumerate(pairwise(points)):
        if (ax, ay) == (bx, by):
            continue
        direction = math.atan2(by - ay, bx - ax)
        if before is not None and abs(math.remainder(direction - before, math.tau)) > FACING:
            found.add(index)
        before = direction
    return found
