"""Measurement of the rows of a path, block by block in random order, on a quiet and a busy host."""

import random
import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from bench.path.processes import lacking, loaded
from bench.path.vehicle import Ports, Vehicle, compiled, free_ports
from bench.reaction.responders import LOADS
from bench.series import Series

SEED = 20_240_607
WARM = 20
BUSY = 4  # processes with a busy loop, on the busy host


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table: the processes between both ends of a path."""

    name: str
    start: Callable[[Ports], AbstractContextManager[None]]
    package: str = ""  # required, by its name in requirements-bench.lock

    @property
    def lacks(self) -> str:
        """The missing package; empty when the row can run."""
        return lacking(self.package)


def measured(rows: Sequence[Row], blocks: int, rounds: int, *, requests: bool) -> list[Series]:
    """Return the samples of all rows."""
    here = [row for row in rows if not row.lacks]
    samples: dict[tuple[str, str], list[int]] = {
        (row.name, load): [] for row in here for load in LOADS
    }
    with tempfile.TemporaryDirectory() as folder:
        vehicle = compiled(Path(folder))
        for row, load in order(here, blocks):
            with loaded(BUSY if load == "busy" else 0):
                samples[row.name, load] += block(vehicle, row, rounds, requests=requests)
    return [series(name, some) for name, some in samples.items()]


def order(rows: Sequence[Row], blocks: int) -> list[tuple[Row, str]]:
    """Return the random order of rows and loads."""
    shuffler = random.Random(SEED)
    each = [(row, load) for row in rows for load in LOADS]
    return [one for _ in range(blocks) for one in shuffler.sample(each, len(each))]


def block(vehicle: Vehicle, row: Row, rounds: int, *, requests: bool) -> list[int]:
    """Return the durations of a block of rounds, in ns; -1 for a lost round."""
    ports = free_ports(requests=requests)
    with row.start(ports):
        return vehicle.timed(ports, rounds, WARM)


def series(name: tuple[str, str], taken_ns: Sequence[int]) -> Series:
    """Return a row's samples; the note has the number of lost rounds."""
    samples_ns = [each for each in taken_ns if each >= 0]
    lost = len(taken_ns) - len(samples_ns)
    note = f"{lost} of {len(taken_ns):,}" if lost else ""
    return Series(name=name, samples_ns=samples_ns, note=note)
