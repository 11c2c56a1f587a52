"""A random room with furniture, and a free place to start in it."""

import math
import random

from common.settings import Vehicle
from sim.geometry import Rectangle
from sim.world import Box, Plan, Spot, Wall, World
from verification.vehicles.draw import Draw

ATTEMPTS = 200
ROOM_TO_TURN = 0.4  # m around the body at the start


def plan(draw: Draw, vehicle: Vehicle) -> Plan:
    """Return the world of a draw; its start has room to turn."""
    length, width = float(draw.get("world.length", 40.0)), float(draw.get("world.width", 40.0))
    chance = random.Random(f"{draw.seed} world")
    walls = (Wall(points=((0, 0), (length, 0), (length, width), (0, width), (0, 0))),)
    radius = math.hypot(vehicle.length, vehicle.width) / 2 + ROOM_TO_TURN
    start = Spot(
        x=chance.uniform(radius, length - radius),
        y=chance.uniform(radius, width - radius),
        heading=chance.uniform(-math.pi, math.pi),
    )
    boxes: list[Box] = []
    wanted = int(draw.get("world.boxes", 0))
    for number in range(wanted):
        boxes += _box(chance, f"box {number}", (length, width), (start, radius))
    if draw.get("world.step", False):
        boxes += _box(chance, "step", (length, width), (start, radius), low=True)
    return Plan(title=f"draw {draw.seed}", start=start, walls=walls, boxes=tuple(boxes))


def _box(
    chance: random.Random,
    name: str,
    room: tuple[float, float],
    keep_free: tuple[Spot, float],
    *,
    low: bool = False,
) -> list[Box]:
    """Return a box that leaves the start free; none when there is no such place."""
    start, radius = keep_free
    free = Rectangle(radius, radius)
    for _ in range(ATTEMPTS):
        box = Box(
            name=name,
            x=chance.uniform(0, room[0]),
            y=chance.uniform(0, room[1]),
            heading=chance.uniform(-math.pi, math.pi),
            length=chance.uniform(0.1, 1.5),
            width=chance.uniform(0.1, 1.0),
            low=low,
        )
        if not World(walls=(), boxes=(box,)).blocks(free, start.pose):
            return [box]
    return []
