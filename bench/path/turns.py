"""All rows of a part in turn, block by block, on a quiet machine and a busy one."""

import random
import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from bench.path.processes import lacking, loaded
from bench.path.vehicle import Ports, Vehicle, compiled, free_ports
from bench.reaction.page import LOADS
from bench.series import Series

SEED = 20_240_607
WARM = 20
BUSY = 4  # processes that only count, on the busy machine


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table: what is between both ends of a path, and these."""

    name: str
    start: Callable[[Ports], AbstractContextManager[None]]
    package: str = ""  # that it wants, by its name in requirements-bench.lock
    program: str = ""

    @property
    def lacks(self) -> str:
        """What is not installed here; empty when it can run."""
        return lacking(self.package, self.program)


def measured(rows: Sequence[Row], blocks: int, rounds: int, *, asks: bool) -> list[Series]:
    """Return the samples of all, each in so many blocks of so many rounds."""
    here = [row for row in rows if not row.lacks]
    samples: dict[tuple[str, str], list[int]] = {
        (row.name, load): [] for row in here for load in LOADS
    }
    with tempfile.TemporaryDirectory() as folder:
        vehicle = compiled(Path(folder))
        for row, load in turns(here, blocks):
            with loaded(BUSY if load == "busy" else 0):
                samples[row.name, load] += block(vehicle, row, rounds, asks=asks)
    return [series(name, some) for name, some in samples.items()]


def turns(rows: Sequence[Row], blocks: int) -> list[tuple[Row, str]]:
    """Return who is next under which load."""
    shuffler = random.Random(SEED)
    order = [(row, load) for row in rows for load in LOADS]
    return [turn for _ in range(blocks) for turn in shuffler.sample(order, len(order))]


def block(vehicle: Vehicle, row: Row, rounds: int, *, asks: bool) -> list[int]:
    """Return how long so many rounds took, in ns; -1 for what was lost."""
    ports = free_ports(asks=asks)
    with row.start(ports):
        return vehicle.timed(ports, rounds, WARM)


def series(name: tuple[str, str], taken_ns: Sequence[int]) -> Series:
    """Return a row's samples; a note says how many were lost."""
    samples_ns = [each for each in taken_ns if each >= 0]
    lost = len(taken_ns) - len(samples_ns)
    note = f"{lost} of {len(taken_ns):,}" if lost else ""
    return Series(name=name, samples_ns=samples_ns, note=note)
