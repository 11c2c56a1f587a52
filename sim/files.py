"""World files and fault scripts, from disk."""

import tomllib
from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec import Struct

from common.errors import ConfigError
from common.settings import Vehicle
from sim.geometry import Rectangle
from sim.requests import Script
from sim.world import Plan, World

F = TypeVar("F", bound=Struct)

WORLDS = Path(__file__).parent / "worlds"


def load_plan(world: str, vehicle: Vehicle) -> Plan:
    """Read a world by name or path; raise ``ConfigError`` when the vehicle cannot stand there."""
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
    """Read a fault script; raise ``ConfigError`` naming the field that is wrong."""
    return _load(file, Script)


def _load(file: Path, kind: type[F]) -> F:
    try:
        return msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8")), kind)
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: is no TOML: {error}") from None
    except msgspec.ValidationError as error:
        raise ConfigError(f"{file}: {error}") from None
