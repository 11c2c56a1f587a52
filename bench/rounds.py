"""Rows measured side by side: in each round every row has one sample, in an order of its own.

Whatever the machine does meanwhile falls on all rows alike. The garbage collector runs as it does
in a service.
"""

import random
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import repeat

from bench.series import Series

SEED = 20_240_607  # any, but always the same
ROUNDS = 3_000
WARM_UP = 100


@dataclass(frozen=True, slots=True)
class Row:
    """What is measured: a call, made so many times in a sample."""

    name: tuple[str, ...]
    call: Callable[[], object]
    calls: int
    note: str = ""


def measured(rows: Sequence[Row], rounds: int = ROUNDS, warm_up: int = WARM_UP) -> list[Series]:
    """Return the samples of each row; the first ``warm_up`` rounds are not kept."""
    samples: dict[tuple[str, ...], list[int]] = {row.name: [] for row in rows}
    for number, order in enumerate(_orders(list(rows), warm_up + rounds)):
        for row in order:
            took_ns = _sample_ns(row.call, row.calls)
            if number >= warm_up:
                samples[row.name].append(took_ns)
    return [
        Series(name=row.name, calls=row.calls, samples_ns=samples[row.name], note=row.note)
        for row in rows
    ]


def _orders(rows: list[Row], rounds: int) -> Iterator[list[Row]]:
    shuffler = random.Random(SEED)
    for _ in range(rounds):
        shuffler.shuffle(rows)
        yield rows


def _sample_ns(call: Callable[[], object], calls: int) -> int:
    begin_ns = time.perf_counter_ns()
    for _ in repeat(None, calls):
        call()
    return time.perf_counter_ns() - begin_ns
