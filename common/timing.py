"""Parts of a service's health: its reaction times."""

from msgspec import Struct


class Durations(Struct, frozen=True, kw_only=True):
    """Histogram of durations since the service's start."""

    counts: tuple[int, ...]  # one for each of ``Timing.bounds``, and one above the last
    worst: float  # s, 0 without any


class Timing(Struct, frozen=True, kw_only=True):
    """Reaction times of a service; a name with a dot is a hop of the name before the dot."""

    bounds: tuple[float, ...]  # s, rising; upper bounds of the counts
    durations: dict[str, Durations]  # by name
    not_counted: dict[str, int]  # number of unmeasured durations, by reason
