"""Settings, world files and fault scripts of the simulated vehicle."""

from pathlib import Path
from typing import Annotated, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct

from common.config import read_toml
from common.errors import ConfigError
from common.settings import Board, Section, Shared, Vehicle, Wire
from sim.geometry import Rectangle
from sim.requests import Script
from sim.world import Plan, World

F = TypeVar("F", bound=Struct)

WORLDS = Path(__file__).parent / "worlds"

Rate = Annotated[float, Meta(ge=0.01, le=100.0)]


class Drive(Section, frozen=True, kw_only=True):
    """Motor dynamics: the speed loop of RUN, and the ramp of STOP (manual 2.2).

    The real figures are unknown. These brake harder than the 0.6 m/s^2 that safety assumes.
    """

    acceleration: Rate = 1.2  # m/s^2, either way, on RUN
    angular_acceleration: Rate = 3.0  # rad/s^2, on RUN
    coast: Rate = 0.8  # m/s^2, on STOP
    angular_coast: Rate = 2.0  # rad/s^2, on STOP
    # The motion in a 10 ms step must be shorter than the smallest body, or it could pass a wall.
    max_linear: Annotated[float, Meta(gt=0.0, le=5.0)] = 1.5  # m/s
    max_angular: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.5  # rad/s


class Sim(Section, frozen=True, kw_only=True):
    """The simulated vehicle and its world."""

    world: str = "office"  # a name in sim/worlds, or the path of a TOML file
    seed: Annotated[int, Meta(ge=0)] = 1  # of sonar noise and cable faults
    control_port: Annotated[int, Meta(ge=0, le=65535)] = 0  # UDP on 127.0.0.1; 0: none
    drive: Drive = Drive()
    sonar_noise: Annotated[float, Meta(ge=0.0, le=0.5)] = 0.005  # m, standard deviation
    sonar_cone: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.5  # rad, whole opening
    # How the board's own emergency brakes work is unknown. Its sonar brake acts closer than
    # safety's margin of 0.20 m: it is the second line of defence.
    brake_range: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.15  # m
    bumper_brake: Literal["toward", "all"] = "toward"  # what it refuses while pressed
    led_channels: Annotated[int, Meta(ge=0, le=256)] = 16  # the board refuses others


class Config(Shared, frozen=True, kw_only=True):
    """Sections that the simulated vehicle reads."""

    board: Board = Board()
    wire: Wire = Wire()
    vehicle: Vehicle = Vehicle()
    sim: Sim = Sim()


def load_plan(world: str, vehicle: Vehicle) -> Plan:
    """Read a world by name or path; raise ``ConfigError`` when its start is blocked."""
    file = Path(world) if world.endswith(".toml") else WORLDS / f"{world}.toml"
    if not file.is_file():
        known = ", ".join(sorted(path.stem for path in WORLDS.glob("*.toml")))
        raise ConfigError(f"sim.world = {world!r}: no such file; known worlds are {known}")
    plan = _load(file, Plan)
    body = Rectangle(vehicle.length / 2, vehicle.width / 2)
    if World.of(plan).blocks(body, plan.start.pose):
        raise ConfigError(f"{file}: start: the vehicle stands in a wall or a box")
    return plan


def load_script(file: Path) -> Script:
    """Read a fault script; raise ``ConfigError`` naming the field that is injected."""
    return _load(file, Script)


def _load(file: Path, kind: type[F]) -> F:
    try:
        return msgspec.convert(read_toml(file, str(file)), kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{file}: {error}") from None
