"""Parts of a service's health: its reaction times."""

from typing import Annotated

from msgspec import Struct

from common.verdict import Counts, Few, Name


class Durations(Struct, frozen=True, kw_only=True):
    """Histogram of durations since the service's start."""

    counts: Annotated[tuple[int, ...], Few]  # one for each of ``Timing.bounds``, and one above
    worst: float  # s, 0 without any


class Timing(Struct, frozen=True, kw_only=True):
    """Reaction times of a service; a name with a dot is a hop of the name before the dot."""

    bounds: Annotated[tuple[float, ...], Few]  # s, rising; upper bounds of the counts
    durations: Annotated[dict[Name, Durations], Few]  # by name
    not_counted: Counts  # number of unmeasured durations, by reason
