"""The part ``growth``: all curves, one after the other."""

import tempfile
from importlib.metadata import version
from pathlib import Path

from bench.growth.curves import COUNTS, WATCHED_S, consumers, pairs, robot, robots
from bench.growth.page import CONSUMERS, KEYS, ROBOTS, SIZES
from bench.load.board import compiled
from bench.series import Series


def measure() -> list[Series]:
    """Return all points."""
    with tempfile.TemporaryDirectory() as folder, robot(compiled(Path(folder))) as it:
        made = consumers(it, COUNTS[CONSUMERS], WATCHED_S)
        for curve in (KEYS, SIZES):
            made += pairs(it, curve, COUNTS[curve], WATCHED_S)
    return made + robots(COUNTS[ROBOTS], WATCHED_S)


def versions() -> str:
    """Return what is measured, with versions."""
    return ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgpack"))
