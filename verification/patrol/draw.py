"""Random rooms, routes, sources of fixes and incidents of a seed."""

import math
import random

from msgspec import Struct
from msgspec.structs import replace

from common.motion import Twist
from sim.geometry import Pose
from sim.vehicle import moved
from sim.world import Plan, Spot, Wall
from t2 import messages as m
from verification.localization.source import FixModel
from verification.search.bus import ROBOT

NAME = "proof"  # of the route
FREE = 2.0  # m from a wall to the route
SPACING = 0.1  # m between the points of a curve
DRIVE_S, LEAST, MOST = 25.0, 3.0, 25.0  # s of driving at the route's speed; m
ATTEMPTS = 100  # for a piece that stays in the room
BLIND = 0.25  # share of the vehicles without a source of fixes
LOOP, PERSON, CURVE = 0.4, 0.4, 0.4  # shares
INCIDENTS = (
    "localization_killed", "odom_killed", "patrol_killed",
    "localization_stalled", "odom_stalled", "patrol_stalled", "takeover",
)  # fmt: skip

Point = tuple[float, float]


class Person(Struct, frozen=True, kw_only=True):
    """A person who steps before the vehicle."""

    at: float  # s after the start of the round
    ahead: float  # m from the middle of the vehicle
    speed: float  # m/s, across its way; 0 stands in it
    seconds: float  # until the person is gone


class Scene(Struct, frozen=True, kw_only=True):
    """All that surrounds one vehicle."""

    plan: Plan
    route: m.Route
    source: FixModel | None
    people: tuple[Person, ...]
    incidents: dict[str, float]  # s after the start of the round


def scene(seed: int, *, faulty: bool) -> Scene:
    """Draw the surroundings of a seed."""
    chance = random.Random(f"{seed} patrol")
    size = chance.uniform(9.0, 25.0), chance.uniform(8.0, 15.0)
    drawn = route(chance, size)
    home = drawn.points[0]
    length, width = size
    walls = (Wall(points=((0, 0), (length, 0), (length, width), (0, width), (0, 0))),)
    start = Spot(x=home.x, y=home.y, heading=chance.uniform(-math.pi, math.pi))
    blind = chance.random() < BLIND
    names = chance.sample(INCIDENTS, chance.choice((0, 1, 1, 2))) if faulty else ()
    return Scene(
        plan=Plan(title=f"route {seed}", start=start, walls=walls),
        route=drawn,
        source=None if blind else _source(chance),
        people=tuple(_person(chance) for _ in range(chance.random() < PERSON)),
        incidents={name: chance.uniform(2.0, 40.0) for name in names},
    )


def _source(chance: random.Random) -> FixModel:
    return FixModel(
        period=chance.choice((1, 2, 5, 10, 20, 50)),
        sigma=chance.uniform(0.01, 0.1),
        heading_sigma=chance.uniform(0.005, 0.05),
        delay=chance.choice((0, 0, 1, 3, 10)),
        outliers=chance.choice((0.0, 0.01, 0.05)),
        gap=chance.choice((0, 0, 50, 200)),
    )


def _person(chance: random.Random) -> Person:
    return Person(
        at=chance.uniform(4.0, 30.0),
        ahead=chance.uniform(1.5, 3.0),
        speed=chance.choice((0.0, 0.5, 1.0, 1.4)),
        seconds=chance.uniform(2.0, 15.0),
    )


def route(chance: random.Random, size: Point) -> m.Route:
    """Draw a route that keeps its distance from the walls of a room."""
    speed = chance.uniform(0.2, 1.0)
    is_loop = chance.random() < LOOP
    wanted = min(MOST, max(LEAST, speed * DRIVE_S * (1.0 if is_loop else 0.5)))
    points = _line(chance, size, wanted * (0.7 if is_loop else 1.0))
    if is_loop and math.dist(points[0], points[-1]) > SPACING:
        points.append(points[0])
    marked = [m.RoutePoint(x=round(x, 3), y=round(y, 3)) for x, y in points]
    marked[0] = replace(marked[0], station="home")
    count = min(chance.randint(0, 3), len(marked) - 2 if is_loop else len(marked) - 1)
    for number, index in enumerate(sorted(chance.sample(range(1, len(marked) - is_loop), count))):
        stay = chance.uniform(0.0, 3.0)
        marked[index] = replace(marked[index], station=f"station {number + 1}", stay=stay)
    return m.Route(
        name=NAME,
        robot=ROBOT,
        speed=speed,
        corridor=chance.uniform(0.4, 1.0),
        blocked=chance.choice(("wait", "return", "stop")),
        points=tuple(marked),
    )


def _line(chance: random.Random, size: Point, wanted: float) -> list[Point]:
    """Return points of straight lines and curves of about this length."""
    x, y = (chance.uniform(FREE, side - FREE) for side in size)
    at = Pose(x, y, chance.uniform(0, math.tau))
    points, length = [(at.x, at.y)], 0.0
    while length < wanted:
        for _ in range(ATTEMPTS):
            piece = _piece(chance, at)
            if all(_is_free((pose.x, pose.y), size) for pose in piece):
                break
        else:
            at = Pose(at.x, at.y, chance.uniform(0, math.tau))
            continue
        length += math.dist(points[-1], (piece[0].x, piece[0].y)) * len(piece)
        points += [(pose.x, pose.y) for pose in piece]
        at = piece[-1]
    return points


def _piece(chance: random.Random, at: Pose) -> list[Pose]:
    """Return the poses of a curve, or the end of a straight line after a corner."""
    if chance.random() < CURVE:
        radius, angle = chance.uniform(0.8, 3.0), chance.uniform(0.5, math.pi)
        side = chance.choice((1.0, -1.0))
        steps = math.ceil(radius * angle / SPACING)
        twist = Twist(1.0, side / radius)
        return [moved(at, twist, radius * angle * step / steps) for step in range(1, steps + 1)]
    corner = chance.choice((0.0, chance.uniform(-1.0, 1.0), chance.uniform(-math.pi, math.pi)))
    there = Pose(at.x, at.y, at.heading + corner)
    return [moved(there, Twist(1.0, 0.0), chance.uniform(1.0, 6.0))]


def _is_free(point: Point, size: Point) -> bool:
    return all(FREE <= at <= side - FREE for at, side in zip(point, size, strict=True))
