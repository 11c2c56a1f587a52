"""Random parameters of a run: a vehicle, a room, an operator and perhaps faults.

A draw is a seed and the parameters that differ from the simulator's defaults. Without a parameter
the default applies.
"""

import math
import random
from functools import cache
from pathlib import Path

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from common.config import Setting, build
from common.settings import Place, Vehicle, sonar_mounts
from sim.geometry import Rectangle
from sim.model import Model
from sim.world import Box, Plan, Spot, Wall, World

FILE = Path(__file__).with_name("ranges.toml")
TURN_BRAKING = "vehicle.angular_deceleration"  # of the settings; the vehicle has a little more
SPARE = 1.1
SIM = "sim."  # prefix of the parameters of the simulated vehicle
FAULTY = 0.5  # share of the runs with faults
MOST_FAULTS = 3
ATTEMPTS = 200
ROOM_TO_TURN = 0.4  # m around the body at the start

Value = bool | int | float | str


class Range(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The values of one parameter."""

    name: str
    why: str
    low: float | None = None
    high: float | None = None
    choices: tuple[Value, ...] = ()
    chance: float = 1.0
    fault: bool = False
    beside: tuple[str, ...] = ()

    def draw(self, chance: random.Random) -> Value:
        """Return a value."""
        if self.choices:
            return chance.choice(self.choices)
        assert self.low is not None, self.name
        assert self.high is not None, self.name
        return float(f"{chance.uniform(self.low, self.high):.3g}")


class Draw(Struct, frozen=True):
    """The parameters of a run; ``seed`` is also that of noise, world and script."""

    seed: int
    values: dict[str, Value]

    @property
    def faulty(self) -> bool:
        """Whether the vehicle has a fault."""
        return any(one.fault and one.name in self.values for one in ranges())

    def get(self, name: str, default: Value) -> Value:
        """Return a parameter, or the default."""
        return self.values.get(name, default)

    def model(self) -> Model:
        """Return the simulated vehicle."""
        own = {name: value for name, value in self.values.items() if name.startswith(SIM)}
        if (weak := self.values.get(TURN_BRAKING)) is not None:
            real = float(weak) * SPARE
            own |= {f"{SIM}drive.angular_coast": real, f"{SIM}drive.angular_acceleration": real}
        given = {name.removeprefix(SIM): Setting(value, name) for name, value in own.items()}
        made = build(Model, given)
        recess = float(self.get("vehicle.recess", 0.0))
        return replace(made, vehicle=mounted(made.vehicle, recess)) if recess else made


def mounted(vehicle: Vehicle, recess: float) -> Vehicle:
    """Return the vehicle with its sonars so deep in the hull, in metres."""
    places = {
        one.name: Place(
            x=one.x - math.cos(one.yaw) * recess,
            y=one.y - math.sin(one.yaw) * recess,
            yaw=one.yaw,
        )
        for one in sonar_mounts(vehicle)
    }
    return replace(vehicle, sonars=places)


@cache
def ranges() -> tuple[Range, ...]:
    """Return all ranges."""
    return tuple(msgspec.toml.decode(FILE.read_bytes(), type=dict[str, list[Range]])["range"])


def draw(seed: int) -> Draw:
    """Draw the parameters of a run; every second one has faults.

    Each parameter has its own random numbers, so a new range without a fault changes no other
    parameter of a seed.
    """
    chance = random.Random(seed)
    faulty = chance.random() < FAULTY
    usual = [one for one in ranges() if not one.fault and _own(seed, one).random() < one.chance]
    faults = [one for one in ranges() if one.fault and not one.beside]
    faults = chance.sample(faults, chance.randint(1, MOST_FAULTS)) if faulty else []
    names = {one.name for one in faults}
    faults += [
        one
        for one in ranges()
        if not names.isdisjoint(one.beside) and _own(seed, one).random() < one.chance
    ]
    return Draw(seed, {one.name: one.draw(_own(seed, one, "value")) for one in (*usual, *faults)})


def _own(seed: int, one: Range, of: str = "chance") -> random.Random:
    """Return the random numbers of one parameter."""
    return random.Random(f"{seed} {one.name} {of}")


def room(draw: Draw, vehicle: Vehicle) -> Plan:
    """Return the room of a draw; its start has room to turn."""
    length, width = float(draw.get("world.length", 40.0)), float(draw.get("world.width", 40.0))
    chance = random.Random(f"{draw.seed} world")
    walls = (Wall(points=((0, 0), (length, 0), (length, width), (0, width), (0, 0))),)
    radius = math.hypot(vehicle.length, vehicle.width) / 2 + ROOM_TO_TURN
    start = Spot(
        x=chance.uniform(radius, length - radius),
        y=chance.uniform(radius, width - radius),
        heading=chance.uniform(-math.pi, math.pi),
    )
    names = [f"box {number}" for number in range(int(draw.get("world.boxes", 0)))]
    names += ["step"] if draw.get("world.step", False) else []
    boxes = [_box(chance, name, (length, width), (start, radius)) for name in names]
    placed = tuple(box for box in boxes if box is not None)
    return Plan(title=f"draw {draw.seed}", start=start, walls=walls, boxes=placed)


def _box(
    chance: random.Random, name: str, room: tuple[float, float], keep_free: tuple[Spot, float]
) -> Box | None:
    """Return a box that leaves the start free; None when there is no such place."""
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
            low=name == "step",
        )
        if not World(walls=(), boxes=(box,)).blocks(free, start.pose):
            return box
    return None
