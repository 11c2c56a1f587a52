"""The part ``start``: in each round every process is started once, in an order of its own."""

import random
from collections import defaultdict
from importlib.metadata import version

from bench.path.processes import packages
from bench.series import Series
from bench.start.memory import held
from bench.start.page import MEMORY
from bench.start.rows import ROWS, site

SEED = 20_240_607
ROUNDS = 100
WARM_UP = 2  # until the files are in the page cache


def measure(rounds: int = ROUNDS) -> list[Series]:
    """Return the times of all starts, and what the processes hold in memory."""
    samples: dict[tuple[str, ...], list[int]] = defaultdict(list)
    shuffler, rows = random.Random(SEED), list(ROWS)
    with site() as here:
        for number in range(WARM_UP + rounds):
            shuffler.shuffle(rows)
            for row in rows:
                for name, ns in row(here).items():
                    samples[name] += [ns] if number >= WARM_UP else []
    times = [Series(name=name, samples_ns=some) for name, some in sorted(samples.items())]
    memory = [
        Series(name=(MEMORY, name), samples_ns=(), note=f"{rss} {pss}")
        for name, (rss, pss) in held().items()
    ]
    return times + memory


def versions() -> str:
    """Return what is started, with versions."""
    told = ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgspec"))
    return f"{told}, {packages()}"
