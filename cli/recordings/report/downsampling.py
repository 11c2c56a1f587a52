"""Fewer points that look the same: an hour at 50 Hz is 180 000 of them. Pure."""

import math
from collections.abc import Iterator, Sequence


def thinned(
    times: Sequence[float], values: Sequence[float], most: int = 4000
) -> tuple[list[float], list[float]]:
    """Return at most about so many points; every peak, dip and hole stays where it was."""
    if len(times) <= most:
        return list(times), list(values)
    # Up to four points of each run of neighbours are kept.
    length = math.ceil(4 * len(times) / most)
    kept = [
        index
        for begin in range(0, len(times), length)
        for index in _extremes(values, range(begin, min(begin + length, len(times))))
    ]
    return [times[index] for index in kept], [values[index] for index in kept]


def _extremes(values: Sequence[float], run: range) -> Iterator[int]:
    known = [index for index in run if not math.isnan(values[index])]
    holes = [index for index in run if math.isnan(values[index])][:1]
    if known:
        holes += [min(known, key=values.__getitem__), max(known, key=values.__getitem__), known[-1]]
    yield from sorted(set(holes))
