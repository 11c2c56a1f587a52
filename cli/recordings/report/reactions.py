"""Reaction times of the bridge during a recording, from its histograms. Pure.

The bridge publishes histograms since its start, so the counts before the recording are subtracted.
The worst value belongs to the recording only if it rose meanwhile. Otherwise the bound of the
slowest bucket replaces it.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from common.messages import Durations, Health, Timing
from services.bridge.timing import quantile

EMPTY = Timing(bounds=(), durations={}, not_counted={})


@dataclass(frozen=True, slots=True)
class Reaction:
    """A reaction or one of its hops; durations in s, None if nothing was measured."""

    name: str
    count: int
    p50: float | None
    p99: float | None
    worst: float | None


def reactions(processes: Iterable[tuple[Health, Health]]) -> list[Reaction]:
    """Return the sum over all bridge processes, from the first and last health of each."""
    bounds: tuple[float, ...] = ()
    sums: dict[str, Counter[int]] = {}
    worst: dict[str, float] = {}
    for first, last in processes:
        early, late = first.timing or EMPTY, last.timing or EMPTY
        bounds = late.bounds or bounds
        for name, each in late.durations.items():
            before = early.durations.get(name)
            counts = _since(before, each)
            sums.setdefault(name, Counter()).update(dict(enumerate(counts)))
            if before is None or each.worst > before.worst:
                worst[name] = max(worst.get(name, 0.0), each.worst)
    return [_reaction(name, bounds, counts, worst.get(name)) for name, counts in sums.items()]


def _since(before: Durations | None, now: Durations) -> list[int]:
    if before is None:
        return list(now.counts)
    return [late - early for early, late in zip(before.counts, now.counts, strict=True)]


def _reaction(
    name: str, bounds: tuple[float, ...], counts: Counter[int], worst: float | None
) -> Reaction:
    total = sum(counts.values())
    if not total:
        return Reaction(name, 0, None, None, None)
    slowest = max(bucket for bucket, count in counts.items() if count)
    bound = bounds[slowest] if slowest < len(bounds) else bounds[-1]
    durations = Durations(
        counts=tuple(counts[bucket] for bucket in range(len(bounds) + 1)),
        worst=worst if worst is not None else bound,
    )
    p50, p99 = (quantile(bounds, durations, share) for share in (0.5, 0.99))
    return Reaction(name, total, p50, p99, durations.worst)
