"""Many runs in parallel, and their results as JSON lines."""

import multiprocessing
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

from verification.vehicles.draw import draw
from verification.vehicles.run import Result, run


def results(seeds: Iterable[int], processes: int) -> Iterator[Result]:
    """Yield the results of these seeds, in the order in which they are ready."""
    with multiprocessing.get_context("spawn").Pool(processes, _be_nice) as pool:
        yield from pool.imap_unordered(drawn_and_run, seeds, chunksize=4)


def drawn_and_run(seed: int) -> Result:
    """Return the result of one seed."""
    return run(draw(seed))


def read(file: Path) -> dict[int, Result]:
    """Return the results of earlier runs by their seeds; none without the file."""
    if not file.exists():
        return {}
    lines = file.read_bytes().splitlines()
    found = [msgspec.json.decode(line, type=Result) for line in lines]
    return {result.seed: result for result in found}


def _be_nice() -> None:
    os.nice(10)
