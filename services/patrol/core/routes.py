"""Checks of a route that its types do not make."""

import math
from itertools import pairwise

from services.patrol.core.track import Track
from t2 import messages as m
from t2.messages import Phrase

LEAST = 0.5  # m, of a whole route
GAP = 50.0  # m between two points; taught ones are nearer


def problem(route: m.Route) -> Phrase | None:
    """Return why a route cannot be driven; None if it can."""
    if not route.points[0].station:
        return Phrase("route.no_home")
    return _twice(route) or _gap(route) or _short(route)


def length(route: m.Route) -> float:
    """Return the length of a route, m."""
    return Track([(each.x, each.y) for each in route.points]).length


def stations(route: m.Route) -> tuple[str, ...]:
    """Return the names of the stations in their order."""
    return tuple(each.station for each in route.points if each.station)


def _twice(route: m.Route) -> Phrase | None:
    seen: dict[str, int] = {}
    for number, point in enumerate(route.points, 1):
        if point.station and point.station in seen:
            fields: dict[str, m.Field] = {
                "station": point.station,
                "first": seen[point.station],
                "second": number,
            }
            return Phrase("route.station_twice", fields)
        seen[point.station] = number
    return None


def _gap(route: m.Route) -> Phrase | None:
    for number, (a, b) in enumerate(pairwise(route.points), 1):
        distance = math.dist((a.x, a.y), (b.x, b.y))
        if distance > GAP:
            return Phrase(
                "route.gap",
                {"first": number, "second": number + 1, "distance": distance, "most": GAP},
            )
    return None


def _short(route: m.Route) -> Phrase | None:
    found = length(route)
    return Phrase("teach.short", {"length": found, "least": LEAST}) if found < LEAST else None
