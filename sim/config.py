"""Settings, profiles and worlds of the simulated vehicle, from their files.

A profile is a file ``profiles/NAME.toml`` with parameters of ``sim.model``. The services read none
of them. The settings that they need to drive such a vehicle are its ``stack``.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta, Struct

from common.config import DEFAULT, Setting, build, flatten, read_toml
from common.errors import ConfigError
from common.settings import Board, Section, Shared, Vehicle, Wire, allowed
from sim.geometry import Rectangle
from sim.model import Model
from sim.world import Plan, World
from t2.text_file import expanded

F = TypeVar("F", bound=Struct)

WORLDS = Path(__file__).parent / "worlds"
PROFILES = Path(__file__).parent / "profiles"
IDEAL = Model()
HEAD = ("title", "source", "stack")  # of a profile


class Sim(Section, frozen=True, kw_only=True):
    """The simulated vehicle. ``--profile`` changes its parameters, see sim/README.md."""

    world: str = "office"  # a name in sim/worlds, or the path of a TOML file
    seed: Annotated[int, Meta(ge=0)] = 1  # of all noise and faults
    control_port: Annotated[int, Meta(ge=0, le=65535)] = 0  # UDP on 127.0.0.1; 0: none
    camera_port: Annotated[int, Meta(ge=0, le=65535)] = 0  # TCP on 127.0.0.1, of sim.camera
    # a source of localization.sources: the true pose is measured, and sent as it; empty: none
    fix_source: Annotated[str, Meta(pattern=r"^([a-z][a-z0-9_-]{0,31})?\Z")] = ""
    fix_rate: Annotated[float, allowed("Hz", ge=0.1, le=20.0)] = 2.0
    fix_sigma: Annotated[float, allowed("m", gt=0.0, le=10.0)] = 0.03  # of x and y
    fix_heading_sigma: Annotated[float, allowed("rad", gt=0.0, le=3.0)] = 0.02
    fix_delay: Annotated[float, allowed("s", ge=0.0, le=10.0)] = 0.1
    fix_outliers: Annotated[float, allowed(ge=0.0, le=1.0)] = 0.0  # share, some metres off
    fix_gap: Annotated[float, allowed("s", ge=0.0, le=60.0)] = 0.0  # without any, in each minute


class Config(Shared, frozen=True, kw_only=True):
    """Sections that the simulated vehicle reads."""

    board: Board = Board()
    wire: Wire = Wire()
    vehicle: Vehicle = Vehicle()
    sim: Sim = Sim()


class Profile(Section, frozen=True, kw_only=True):
    """A profile file; ``parameters`` are those of ``Model``, by path."""

    title: str
    source: str  # where it is known from, or what the manual leaves open
    stack: str = ""  # settings with which the services drive such a vehicle
    parameters: dict[str, Any]


def add_profiles(parser: argparse.ArgumentParser) -> None:
    """Add the option that names profiles."""
    parser.add_argument(
        "--profile", action="append", default=[], metavar="NAME",
        help="unkind vehicle, a file in sim/profiles or a path; may be repeated",
    )  # fmt: skip


def known_profiles() -> list[str]:
    """Return the names of the shipped profiles."""
    return _stems(PROFILES)


def read_profile(name: str) -> Profile:
    """Read a profile by name or path; raise ``ConfigError`` for an unknown or invalid one."""
    file = _named(name, PROFILES)
    if not file.is_file():
        known = ", ".join(known_profiles())
        raise ConfigError(f"--profile {name}: no such file; known profiles are {known}")
    table = read_toml(file, str(file))
    parameters = {path: value for path, value in flatten(table) if path not in (*HEAD, "")}
    head = {key: table[key] for key in HEAD if key in table}
    return _convert({**head, "parameters": parameters}, Profile, file)


def load_model(names: Sequence[str], ideal: Model = IDEAL) -> Model:
    """Return the vehicle of these profiles; raise ``ConfigError`` when two of them contradict."""
    given = {path: Setting(value, DEFAULT) for path, value in flatten(ideal)}
    chosen: dict[str, tuple[str, Any]] = {}
    for name in names:
        for path, value in read_profile(name).parameters.items():
            other, before = chosen.setdefault(path, (name, value))
            if before != value:
                raise ConfigError(
                    f"--profile {name}: {path} = {value!r}, but profile {other} has {before!r}; "
                    "leave one of them out"
                )
            given[path] = Setting(value, f"profile {name}")
    return build(Model, given)


def profile_list() -> str:
    """Return a line for each profile, with what the services need for it."""
    lines = []
    for name in known_profiles():
        profile = read_profile(name)
        lines.append(f"{name:20} {profile.title}")
        lines += [f"{'':20} stack: --set {each}" for each in profile.stack.split()]
    return "\n".join(lines)


def load_plan(world: str, vehicle: Vehicle) -> Plan:
    """Read a world by name or path; raise ``ConfigError`` when its start is blocked."""
    file = _named(world, WORLDS)
    if not file.is_file():
        known = ", ".join(_stems(WORLDS))
        raise ConfigError(f"sim.world = {world!r}: no such file; known worlds are {known}")
    plan = _convert(read_toml(file, str(file)), Plan, file)
    body = Rectangle(vehicle.length / 2, vehicle.width / 2)
    if World.of(plan).blocks(body, plan.start.pose):
        raise ConfigError(f"{file}: start: the vehicle stands in a wall or a box")
    return plan


def _stems(folder: Path) -> list[str]:
    return sorted(file.stem for file in folder.glob("*.toml"))


def _named(name: str, folder: Path) -> Path:
    try:
        return Path(expanded(name)) if name.endswith(".toml") else folder / f"{name}.toml"
    except ValueError as error:
        raise ConfigError(str(error)) from None


def _convert(table: dict[str, Any], kind: type[F], file: Path) -> F:
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{file}: {error}") from None
