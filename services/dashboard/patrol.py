"""Patrol on the page: the state of its round, and its routes.

Routes are no part of snapshots: a browser asks for the list, and for the one that it draws. The
answers are read from the robot once for all viewers, until ``version`` rises: a route may have
changed.
"""

import math
from collections.abc import Callable
from functools import partial

import msgspec
from msgspec import Struct

from common import clock
from common.bus.bus import Bus
from common.freshness import NS_PER_S, Latest, fresh
from services.dashboard.i18n import Texts, label, rendered
from services.dashboard.telemetry_cache import TelemetryCache
from t2 import keys
from t2 import messages as m
from t2.catalogue import WORDS

DRAWN_MAX = 2000  # points of a route: a link that carries snapshots must not wait for more
KEPT_S = 10.0  # of an answer: a page that is loaded later sees files that were changed by hand
PLACES = 2  # decimals of a coordinate: cm

SendText = Callable[[bytes], None]


class TeachingView(Struct, frozen=True):
    """The route that is being taught, and why nothing more of it is recorded."""

    route: str
    length: float
    stations: tuple[str, ...]
    text: Texts


class NextView(Struct, frozen=True):
    """The next round of the schedule."""

    schedule: str
    route: str
    t: float  # s, wall clock of the robot


class PatrolView(Struct, frozen=True, kw_only=True):
    """The state of patrol, with its texts."""

    state: m.RoundState | None = None  # None: patrol is silent
    word: Texts = Texts("", "")  # the state
    text: Texts
    actions: tuple[m.RoundAction, ...] = ()
    route: str = ""
    homeward: bool = False
    progress: float | None = None
    length: float | None = None
    station: str = ""
    left: float | None = None
    deviation: float | None = None
    sigma: float | None = None
    corridor: float | None = None
    teaching: TeachingView | None = None
    next: NextView | None = None
    version: int  # of the routes


class RouteLine(Struct, frozen=True):
    """A route of the list."""

    name: str
    length: float | None
    stations: int
    problem: Texts | None  # why it cannot be driven


class RouteList(Struct, frozen=True, tag_field="k", tag="routes"):
    """The routes of the robot, for one viewer."""

    version: int
    routes: list[RouteLine]


class RouteView(Struct, frozen=True, tag_field="k", tag="route"):
    """The route that is drawn, in ``map``, for one viewer."""

    version: int
    name: str
    corridor: float
    points: list[tuple[float, float]]
    stations: list[tuple[str, float, float]]


class Routes:
    """The routes of one robot, as messages to its viewers."""

    def __init__(self, bus: Bus) -> None:
        self.version = 0
        self._bus = bus
        self._seen: tuple[int, str, bool] | None = None
        self._messages: dict[str | None, Latest[bytes]] = {}  # by name; None: the list
        self._waiting: dict[str | None, list[SendText]] = {}

    def observe(self, state: m.PatrolState) -> None:
        """Note a restart, another round, and the end of teaching: the files may have changed."""
        seen = state.boot, state.round, state.teaching is None
        if seen != self._seen:
            self._seen = seen
            self.change()

    def change(self) -> None:
        """Read the routes anew."""
        self.version += 1
        self._messages.clear()
        self._waiting.clear()

    def ask(self, name: str | None, send: SendText) -> None:
        """Send a route, or the list; nothing if it cannot be read: the browser asks again."""
        message = self._messages.get(name)
        if message and fresh(message, clock.now_ns(), KEPT_S):
            send(message.value)
            return
        waiting = self._waiting.setdefault(name, [])
        waiting.append(send)
        if len(waiting) == 1:
            self._bus.call(
                keys.ROUTES,
                m.RoutesRequest(route=name),
                partial(self._answered, self.version, name),
                partial(self._refused, self.version, name),
            )

    def _answered(self, version: int, name: str | None, reply: m.RoutesReply) -> None:
        if version != self.version:
            return
        view = (
            route_list(version, reply) if reply.route is None else route_view(version, reply.route)
        )
        message = msgspec.json.encode(view)
        self._messages[name] = Latest(message, clock.now_ns())
        for send in self._waiting.pop(name, ()):
            send(message)

    def _refused(self, version: int, name: str | None, _: m.Refusal) -> None:
        if version == self.version:
            self._waiting.pop(name, None)


def patrol_view(telemetry: TelemetryCache, routes: int, now_ns: int) -> PatrolView | None:
    """Return what the page shows of patrol; None of a robot that has none."""
    state = telemetry.newest(keys.PATROL, now_ns)
    if state is None:
        is_silent = telemetry.has_received(keys.PATROL)
        return PatrolView(text=label("patrol_silent"), version=routes) if is_silent else None
    teaching, following = state.teaching, state.next
    return PatrolView(
        state=state.state,
        word=Texts(*WORDS[state.state]),
        text=rendered(state.phrases, state.text),
        actions=state.actions,
        route=state.route,
        homeward=state.homeward,
        progress=state.progress,
        length=state.length,
        station=state.station,
        left=state.left,
        deviation=state.deviation,
        sigma=state.sigma,
        corridor=state.corridor,
        teaching=teaching_view(teaching) if teaching else None,
        next=next_view(following) if following else None,
        version=routes,
    )


def teaching_view(of: m.Teaching) -> TeachingView:
    """Return what the page shows of a route that is being taught."""
    return TeachingView(of.route, of.length, of.stations, rendered(of.phrases, of.text))


def next_view(of: m.NextRound) -> NextView:
    """Return what the page shows of the next round."""
    return NextView(of.schedule, of.route, of.t_ns / NS_PER_S)


def route_list(version: int, reply: m.RoutesReply) -> RouteList:
    """Return the list of routes, with their problems."""
    lines = [
        RouteLine(
            each.name,
            each.length,
            len(each.stations),
            rendered(each.phrases, each.problem) if each.problem else None,
        )
        for each in reply.routes
    ]
    return RouteList(version, lines)


def route_view(version: int, route: m.Route) -> RouteView:
    """Return a route as it is drawn."""
    line = [(round(each.x, PLACES), round(each.y, PLACES)) for each in route.points]
    stations = [
        (each.station, *at) for each, at in zip(route.points, line, strict=True) if each.station
    ]
    return RouteView(version, route.name, route.corridor, thinned(line), stations)


def thinned(line: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return at most ``DRAWN_MAX`` points of a line, with both ends and its sharpest bends."""
    last = len(line) - 1
    if last < DRAWN_MAX:
        return line

    def bend(at: int) -> float:
        """Return how far a point is off the straight line between its neighbours, m."""
        (ax, ay), (x, y), (bx, by) = line[at - 1 : at + 2]
        area = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        return abs(area) / (math.dist((ax, ay), (bx, by)) or 1.0)

    half = DRAWN_MAX // 2 - 1
    regular = range(0, last, math.ceil(last / half))
    sharpest = sorted(range(1, last), key=bend)[-half:]
    return [line[at] for at in sorted({*regular, *sharpest, last})]
