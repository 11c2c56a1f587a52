"""Profiles of unkind vehicles: named settings of the simulator on top of the settings files.

A profile is a file ``profiles/NAME.toml`` with the tables ``[sim]``, ``[wire]`` and ``[vehicle]``
of the simulated vehicle alone: the services read none of them. What one of them needs to drive such
a vehicle is its ``stack``.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from common.config import Table, flatten, read_toml
from common.errors import ConfigError

PROFILES = Path(__file__).parent / "profiles"


class Profile(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A profile file."""

    title: str
    source: str  # where it is known from, or what the manual leaves open
    stack: str = ""  # settings with which the services drive such a vehicle
    sim: dict[str, Any] = {}
    wire: dict[str, Any] = {}
    vehicle: dict[str, Any] = {}

    @property
    def settings(self) -> dict[str, Any]:
        """Its settings by path."""
        sections = {"sim": self.sim, "wire": self.wire, "vehicle": self.vehicle}
        return {path: value for path, value in flatten(sections) if value != {}}


def add_argument(parser: argparse.ArgumentParser) -> None:
    """Add the option that names profiles."""
    parser.add_argument(
        "--profile", action="append", default=[], metavar="NAME",
        help="unkind vehicle, a file in sim/profiles or a path; may be repeated",
    )  # fmt: skip


def known() -> list[str]:
    """Return the names of the shipped profiles."""
    return sorted(file.stem for file in PROFILES.glob("*.toml"))


def read(name: str) -> Profile:
    """Read a profile by name or path; raise ``ConfigError`` for an unknown or invalid one."""
    file = Path(name) if name.endswith(".toml") else PROFILES / f"{name}.toml"
    if not file.is_file():
        raise ConfigError(
            f"--profile {name}: no such file; known profiles are {', '.join(known())}"
        )
    try:
        return msgspec.convert(read_toml(file, str(file)), Profile)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{file}: {error}") from None


def tables(names: Sequence[str]) -> tuple[Table, ...]:
    """Return the settings of these profiles; raise ``ConfigError`` when two of them contradict."""
    given: dict[str, tuple[str, Any]] = {}
    for name in names:
        for path, value in read(name).settings.items():
            other, before = given.setdefault(path, (name, value))
            if before != value:
                raise ConfigError(
                    f"--profile {name}: {path} = {value!r}, but profile {other} has {before!r}; "
                    "leave one of them out"
                )
    return tuple((f"profile {name}", read(name).settings) for name in names)


def listing() -> str:
    """Return a line for each profile, with what the services need for it."""
    lines = []
    for name in known():
        profile = read(name)
        lines.append(f"{name:20} {profile.title}")
        lines += [f"{'':20} stack: --set {each}" for each in profile.stack.split()]
    return "\n".join(lines)
