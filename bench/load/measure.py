"""Measurement of the benchmark ``load``: throughput of the bridge, cost of the stack on board."""

import tempfile
from importlib.metadata import version
from pathlib import Path

from bench.load import cost, throughput
from bench.load.board import compiled
from bench.path.processes import packages
from bench.series import Series


def measure() -> list[Series]:
    """Return all samples."""
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(Path(folder))
        return [*throughput.measure(program), *cost.measure(program)]


def versions() -> str:
    """Return the measured packages with versions."""
    names = ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgpack"))
    return f"{names}, {packages()}"
