"""Made-up times of starts."""

from bench.series import Series
from bench.start.rows import (
    BARE,
    BRIDGE,
    FIRST_BREAK,
    FIRST_STOP,
    NOTHING,
)  # fmt: skip


def made_up(stop_ms: int, samples: int = 10) -> list[Series]:
    times = {NOTHING: 10, BARE: 40, (BRIDGE, FIRST_BREAK): 100, (BRIDGE, FIRST_STOP): stop_ms}
    return [Series(name=name, samples_ns=[ms * 1_000_000] * samples) for name, ms in times.items()]
