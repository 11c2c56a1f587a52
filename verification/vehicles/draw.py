"""Random parameters of a run: a vehicle, a world, an operator and perhaps faults.

A draw is a seed and the parameters that differ from the simulator's defaults. Without a parameter
the default applies, so that any part of a draw is a draw again: the shrinker relies on it.
"""

import random
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import msgspec
from msgspec import Struct

FILE = Path(__file__).with_name("ranges.toml")
FAULTY = 0.5  # share of the runs with faults
MOST_FAULTS = 3

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

    def draw(self, chance: random.Random) -> Value:
        """Return a value."""
        if self.choices:
            return chance.choice(self.choices)
        assert self.low is not None, self.name
        assert self.high is not None, self.name
        return float(f"{chance.uniform(self.low, self.high):.3g}")

    @property
    def text(self) -> str:
        """The values as text."""
        if self.choices:
            return ", ".join(str(choice).lower() for choice in self.choices)
        return f"{self.low:g} to {self.high:g}"


class Ranges(Struct, frozen=True, forbid_unknown_fields=True):
    """The file of ranges."""

    range: tuple[Range, ...]


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

    def without(self, name: str) -> "Draw":
        """Return the draw with the default of one parameter."""
        return Draw(self.seed, {key: self.values[key] for key in self.values if key != name})

    def settings(self) -> dict[str, object]:
        """Return the settings of the simulated vehicle as nested tables."""
        tables: dict[str, object] = {"sim": {"seed": self.seed}}
        for name, value in self.values.items():
            if name.startswith("sim."):
                _set(tables, name.split("."), value)
        return tables


@cache
def ranges() -> tuple[Range, ...]:
    """Return all ranges."""
    return msgspec.toml.decode(FILE.read_bytes(), type=Ranges).range


def draw(seed: int, *, faulty: bool | None = None) -> Draw:
    """Draw the parameters of a run; every second one has faults by default.

    Each parameter has its own random numbers, so a new range without a fault changes no other
    parameter of a seed.
    """
    chance = random.Random(seed)
    if faulty is None:
        faulty = chance.random() < FAULTY
    usual = [one for one in ranges() if not one.fault and _own(seed, one).random() < one.chance]
    faults = [one for one in ranges() if one.fault]
    faults = chance.sample(faults, chance.randint(1, MOST_FAULTS)) if faulty else []
    return Draw(seed, {one.name: one.draw(_own(seed, one, "value")) for one in (*usual, *faults)})


def _own(seed: int, one: Range, of: str = "chance") -> random.Random:
    """Return the random numbers of one parameter."""
    return random.Random(f"{seed} {one.name} {of}")


def _set(tables: dict[str, object], path: Iterable[str], value: Value) -> None:
    *sections, last = path
    for section in sections:
        inner = tables.setdefault(section, {})
        assert isinstance(inner, dict)
        tables = inner
    tables[last] = value
