"""Teaching a route: the driven path of the vehicle in the map, and its stations.

Poses are recorded every ``SPACING`` m, and those within ``TOLERANCE`` m of a straight line are left
out. The source in control does not matter. What a round cannot repeat ends the recording: the part
before it is kept.
"""

import math
from itertools import pairwise

from msgspec import Struct

from common.pose import Covariance
from services.patrol.core.routes import LEAST
from services.patrol.core.track import Point, Track
from t2 import messages as m
from t2.messages import MAX_POINTS, Phrase

SPACING, TOLERANCE = 0.1, 0.03  # m
TURNED, LEAST_STEP = 0.3, 0.01  # rad, m: a corner is recorded before the next spacing
LONGEST = 10.0  # m, of a straight line: bounds the work for each point
BACKWARD = 0.2  # m that a vehicle may be driven backward
JUMP = 0.3  # m between two poses, which are 0.04 s apart
CORRIDOR = 0.5  # m, of a new route
CLOSING = 0.3  # m before home: the last point is left out


class Refused(Exception):  # noqa: N818 - as the answer to a call
    """A step of teaching that is not possible now; ``reason`` says why."""

    def __init__(self, reason: Phrase) -> None:
        super().__init__(reason)
        self.reason = reason


class OpenTeaching(Struct, frozen=True):
    """What was taught when the service ended."""

    route: str
    points: tuple[m.RoutePoint, ...]


class Teaching:
    """One route that is being taught."""

    def __init__(self, name: str, robot: str, home: str, stay: float, pose: m.MapPose) -> None:
        if reason := unusable(pose):
            raise Refused(reason)
        self.name = name
        self._robot = robot
        self._placement = pose.boot, pose.placement
        self._before = _place(pose)  # the last pose
        self._last = self._before[:2]  # the last recorded point
        self._heading = self._before[2]  # there
        self._points = [_point(self._last, home, stay)]
        self._pending: list[Point] = []  # recorded ones since the last of ``_points``
        self._length = 0.0  # m, until the last recorded point
        self._back = 0.0  # m driven backward from the foremost place
        self.reason: Phrase | None = None  # why nothing more is recorded

    @classmethod
    def restored(cls, of: OpenTeaching, robot: str) -> "Teaching":
        """Return what was taught before the service restarted; nothing more is recorded."""
        made = cls.__new__(cls)
        made.name, made._robot = of.route, robot
        made._points, made._pending = [*of.points], []
        made._length = Track([(each.x, each.y) for each in of.points]).length
        made.reason = Phrase("teach.restarted")
        return made

    @property
    def open(self) -> OpenTeaching:
        """What a restarted service needs."""
        last = [_point(each) for each in self._pending[-1:]]
        return OpenTeaching(self.name, (*self._points, *last))

    @property
    def stations(self) -> tuple[str, ...]:
        """The names of the stations."""
        return tuple(each.station for each in self._points if each.station)

    @property
    def phrases(self) -> tuple[Phrase, ...]:
        """Why nothing more is recorded; empty while it is."""
        if self.reason is None:
            return ()
        return self.reason, Phrase("teach.ends_here", {"length": self._length})

    @property
    def summary(self) -> tuple[float, int]:
        """Length in m, and number of points."""
        return self._length, len(self._points) + bool(self._pending)

    def on_pose(self, pose: m.MapPose) -> None:
        """Record a pose of the vehicle."""
        if self.reason is None:
            self.reason = unusable(pose) or self._changed(pose) or self._advance(_place(pose))
            if self.reason is not None:
                self._record_here()

    def station(self, name: str, stay: float) -> None:
        """Mark a station where the vehicle is; raise ``Refused``."""
        if self.reason is not None:
            raise Refused(self.reason)
        if name in self.stations:
            raise Refused(Phrase("teach.station_twice", {"station": name}))
        self._record_here()
        self._points.append(_point(self._before[:2], name, stay))
        self._pending.clear()

    def route(self, speed: float) -> m.Route:
        """Return the route that was taught; raise ``Refused`` if it cannot be driven."""
        if self.reason is None:
            self._record_here()
        if self._length < LEAST:
            raise Refused(Phrase("teach.short", {"length": self._length, "least": LEAST}))
        points = [*self._points, *(_point(each) for each in self._pending[-1:])]
        if self._length > 2 * CORRIDOR:
            _close(points)
        return m.Route(
            name=self.name,
            robot=self._robot,
            speed=speed,
            corridor=CORRIDOR,
            points=tuple(points),
        )

    def _changed(self, pose: m.MapPose) -> Phrase | None:
        is_other = (pose.boot, pose.placement) != self._placement
        x, y, _ = _place(pose)
        distance = math.dist((x, y), self._before[:2])
        if is_other or distance > JUMP:
            return Phrase("teach.jump", {"distance": distance})
        return None

    def _advance(self, place: tuple[float, float, float]) -> Phrase | None:
        (x0, y0, _), (x, y, heading) = self._before, place
        step = (x - x0) * math.cos(heading) + (y - y0) * math.sin(heading)
        self._back = max(0.0, self._back - step)
        if self._back > BACKWARD:
            return Phrase("teach.backward")
        self._before = place
        way, turn = math.dist(self._last, (x, y)), math.remainder(heading - self._heading, math.tau)
        if self._back == 0.0 and (way >= SPACING or (abs(turn) > TURNED and way > LEAST_STEP)):
            self._record((x, y))
            self._heading = heading
        if len(self._points) > MAX_POINTS - 3:  # the end, its station, and home
            return Phrase("teach.full", {"points": MAX_POINTS})
        return None

    def _record_here(self) -> None:
        """Record where the vehicle is, or where it was before it drove too far backward."""
        if self._back > BACKWARD:
            return
        here = self._before[:2]
        if self._back > 0:  # it was driven back to this place
            while self._pending and math.dist(self._pending[-1], here) <= BACKWARD:
                self._pending.pop()
            corner = self._points[-1].x, self._points[-1].y
            self._last = self._pending[-1] if self._pending else corner
            line = [*((each.x, each.y) for each in self._points), *self._pending]
            self._length, self._back = Track(line).length, 0.0
        self._record(here)

    def _record(self, point: Point) -> None:
        """Record a point, and leave out those before it that are on its line."""
        if point == self._last:
            return
        self._length += math.dist(self._last, point)
        self._last = point
        corner = self._points[-1].x, self._points[-1].y
        is_long = math.dist(corner, point) > LONGEST
        if self._pending and (is_long or not _is_straight(corner, self._pending, point)):
            self._points.append(_point(self._pending[-1]))
            self._pending.clear()
        self._pending.append(point)


def unusable(pose: m.MapPose) -> Phrase | None:
    """Return why a pose cannot be taught; None if it can."""
    if pose.state != "placed" or pose.pose_covariance is None:
        return Phrase("teach.lost")
    sigma = Covariance.of(pose.pose_covariance).sigma
    if 2 * sigma > CORRIDOR:
        return Phrase("teach.uncertain", {"sigma": sigma, "corridor": CORRIDOR})
    return None


def _is_straight(a: Point, between: list[Point], b: Point) -> bool:
    """Return whether points lie on the line from a to b, in its direction."""
    length = math.dist(a, b)
    if length == 0.0:
        return False
    ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    ways = [(x - a[0]) * ux + (y - a[1]) * uy for x, y in between]
    beside = [abs((x - a[0]) * uy - (y - a[1]) * ux) for x, y in between]
    rising = all(one <= other for one, other in pairwise([0.0, *ways, length]))
    return rising and max(beside) <= TOLERANCE


def _close(points: list[m.RoutePoint]) -> None:
    """End a route at its first point, if it ends near it."""
    home = points[0].x, points[0].y
    if math.dist(home, (points[-1].x, points[-1].y)) > CORRIDOR:
        return
    while not points[-1].station and math.dist(home, (points[-1].x, points[-1].y)) <= CLOSING:
        points.pop()
    points.append(_point(home))


def _place(pose: m.MapPose) -> tuple[float, float, float]:
    return pose.x or 0.0, pose.y or 0.0, pose.heading or 0.0


def _point(at: Point, station: str = "", stay: float = 0.0) -> m.RoutePoint:
    about = {"station": station, "stay": stay} if station else {}  # defaults are not written
    return m.RoutePoint(x=round(at[0], 3), y=round(at[1], 3), **about)  # type: ignore[arg-type]
