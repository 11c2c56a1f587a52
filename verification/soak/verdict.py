"""Verdict of a soak: violations, growth of resources, log, crashes.

A process is judged by its longest life: shorter ones end with a kill, and sessions come and go in
them. After the warm-up the median of the first fifth is compared with that of the last fifth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import NamedTuple

from cli.demo.score import Result

GROWTH_MAX = 2 * 2**20  # bytes of memory
LOG_MAX = 10_000.0  # bytes a fault on average, all services together
SAMPLES_MIN = 10  # of a life that is judged; a fifth of it is 2
WARM_UP_S = 60.0  # at most; of a short soak a tenth


class Sample(NamedTuple):
    """Resources of a process at one time."""

    at_s: float  # since the soak began
    rss: float  # bytes
    threads: float
    descriptors: float


@dataclass(slots=True)
class Record:
    """All observations, after each fault; times in seconds since the soak began."""

    lives: dict[tuple[str, int], list[Sample]] = field(default_factory=dict)  # by name and pid
    faults: int = 0
    violations: list[str] = field(default_factory=list)
    crashes: list[str] = field(default_factory=list)
    log_bytes: int = 0
    tracebacks: int = 0
    seconds: float = 0.0  # duration


def results(record: Record) -> Iterator[Result]:
    """Yield the results; a soak is good when none is False."""
    for name in dict.fromkeys(name for name, _ in record.lives):
        longest = max((it for (each, _), it in record.lives.items() if each == name), key=len)
        yield from growth(name, longest, min(WARM_UP_S, record.seconds / 10))
    rate = record.log_bytes / max(1, record.faults)
    amount = f"{record.log_bytes / 1000:.0f} kB, {rate:.0f} bytes a fault"
    yield "log", amount, 0 < rate <= LOG_MAX
    yield "tracebacks in the log", str(record.tracebacks), record.tracebacks == 0
    yield "crashes", ", ".join(record.crashes) or "none", not record.crashes
    yield "faults", str(record.faults), record.faults > 0
    yield "outside their limits", "; ".join(record.violations) or "none", not record.violations


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
