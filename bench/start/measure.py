"""Measurement of the benchmark ``start``: each round starts every process once, in random order."""

import random
from collections import defaultdict
from importlib.metadata import version

from bench.path.processes import packages
from bench.series import Series
from bench.start.rows import ROWS, site

SEED = 20_240_607
ROUNDS = 100
WARM_UP = 2  # until the files are in the page cache


def measure(rounds: int = ROUNDS) -> list[Series]:
    """Return the times of all starts."""
    samples: dict[tuple[str, ...], list[int]] = defaultdict(list)
    shuffler, rows = random.Random(SEED), list(ROWS)
    with site() as here:
        for number in range(WARM_UP + rounds):
            shuffler.shuffle(rows)
            for row in rows:
                for name, ns in row(here).items():
                    samples[name] += [ns] if number >= WARM_UP else []
    return [Series(name=name, samples_ns=some) for name, some in sorted(samples.items())]


def versions() -> str:
    """Return the measured packages with versions."""
    names = ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgspec"))
    return f"{names}, {packages()}"
