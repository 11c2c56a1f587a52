"""Verdict of a soak: growth of resources, log, crashes, and stuck laps.

A process is judged by its longest life: shorter ones end with a kill, and sessions come and go in
them. After the warm-up the median of the first fifth is compared with that of the last fifth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from cli.demo.score import Result

GROWTH_MAX = 2 * 2**20  # bytes of memory
LOG_MAX = 2000.0  # bytes/s on average, all services together, faults included
SAMPLES_MIN = 10  # of a life that is judged; a fifth of it is 2
WARM_UP_S = 60.0  # at most; of a short soak a tenth
LAP_S = 240.0  # in each such period one lap must be finished; it takes a third without faults
STUCK_S = 165.0  # without a step done: two that time out, and a restart


class Sample(NamedTuple):
    """Resources of a process at one time."""

    at_s: float  # since the soak began
    rss: float  # bytes
    threads: float
    descriptors: float


@dataclass(slots=True)
class Record:
    """All observations, once a second; times in seconds since the soak began."""

    lives: dict[tuple[str, int], list[Sample]] = field(default_factory=dict)  # by name and pid
    events: list[tuple[float, str]] = field(default_factory=list)  # of the driver
    log_bytes: int = 0
    tracebacks: int = 0
    crashes: list[str] = field(default_factory=list)
    faults: int = 0
    seconds: float = 0.0  # duration


def results(record: Record) -> Iterator[Result]:
    """Yield the results; a soak is good when none is False."""
    for name in dict.fromkeys(name for name, _ in record.lives):
        longest = max((it for (each, _), it in record.lives.items() if each == name), key=len)
        yield from growth(name, longest, min(WARM_UP_S, record.seconds / 10))
    rate = record.log_bytes / max(1.0, record.seconds)
    amount = f"{record.log_bytes / 1000:.0f} kB, {rate:.0f} bytes/s"
    yield "log", amount, 0 < rate <= LOG_MAX
    yield "tracebacks in the log", str(record.tracebacks), record.tracebacks == 0
    yield "crashes", ", ".join(record.crashes) or "none", not record.crashes
    yield "faults", str(record.faults), record.faults > 0
    yield from _laps(record)


def growth(name: str, samples: Sequence[Sample], warm_up_s: float) -> Iterator[Result]:
    """Yield the growth of a process's memory, threads and descriptors."""
    warm = [sample for sample in samples if sample.at_s - samples[0].at_s >= warm_up_s]
    if len(warm) < SAMPLES_MIN:
        yield f"{name}: memory", "no run was long enough", False
        return
    fifth = len(warm) // 5
    first, last = (
        Sample(*map(median, zip(*part, strict=True))) for part in (warm[:fifth], warm[-fifth:])
    )
    grown, threads = last.rss - first.rss, last.threads - first.threads
    descriptors, span_s = last.descriptors - first.descriptors, last.at_s - first.at_s
    amount = f"{last.rss / 2**20:.1f} MB, {grown / 2**20:+.2f} in {span_s:.0f} s"
    yield f"{name}: memory", amount, grown < GROWTH_MAX
    held = f"{last.threads:.0f} {threads:+.0f}, {last.descriptors:.0f} {descriptors:+.0f}"
    yield f"{name}: threads, descriptors", held, threads < 1 and descriptors < 1


def _laps(record: Record) -> Iterator[Result]:
    events = [what for _, what in record.events]
    finished, wanted = events.count("lap finished"), int(record.seconds // LAP_S)
    yield "laps finished", f"{finished}, at least {wanted} wanted", finished >= wanted
    steps = [at_s for at_s, what in record.events if what == "step"]
    stuck_s = max(b - a for a, b in pairwise([0.0, *steps, record.seconds]))
    moving = bool(steps) and stuck_s <= STUCK_S
    yield "longest time without a step done", f"{stuck_s:.0f} s", moving
