"""What is measured of a stream: its rate and gaps, its delay, its bandwidth. Pure.

A meter takes samples and tells figures over the last ``window`` of them, as ``ros2 topic hz``,
``delay`` and ``bw`` do. ``lost`` is counted from ``seq`` since the beginning: what the publisher
sent and did not come. Figures are in seconds, bytes and hertz.
"""

import statistics
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise

from common.freshness import NS_PER_S

Figures = dict[str, float | int | str | None]


@dataclass(frozen=True, slots=True)
class Taken:
    """What a meter is told of one sample; ``delay_s`` is None where it cannot be known."""

    received_ns: int
    size: int
    seq: int | None = None
    boot: int | None = None
    delay_s: float | None = None
    clock: str = ""  # by which the delay was taken: "host" or "wall"


@dataclass(slots=True)
class Meter:
    """The last samples of one key."""

    window: int
    taken: deque[Taken] = field(default_factory=deque)
    count: int = 0
    lost: int = 0

    def take(self, sample: Taken) -> None:
        """Count a sample in."""
        before = self.taken[-1] if self.taken else None
        self.taken.append(sample)
        self.count += 1
        if len(self.taken) > self.window:
            self.taken.popleft()
        if before and before.boot == sample.boot and before.seq and sample.seq:
            self.lost += max(0, sample.seq - before.seq - 1)

    def rate(self) -> Figures:
        """Return the rate and the gaps between two samples; None below two."""
        stamps = [sample.received_ns for sample in self.taken]
        gaps = [(later - earlier) / NS_PER_S for earlier, later in pairwise(stamps)]
        mean = statistics.fmean(gaps) if gaps else 0.0
        return {
            "hz": 1 / mean if mean else None,
            "min": min(gaps, default=None),
            "max": max(gaps, default=None),
            "std_dev": statistics.pstdev(gaps) if gaps else None,
            "lost": self.lost,
            "window": len(stamps),
        }

    def delay(self) -> Figures:
        """Return how long samples were under way; by the wall clocks, their difference is in it."""
        delays = sorted(each.delay_s for each in self.taken if each.delay_s is not None)
        return {
            "mean": statistics.fmean(delays) if delays else None,
            "min": delays[0] if delays else None,
            "p50": quantile(delays, 0.50),
            "p99": quantile(delays, 0.99),
            "max": delays[-1] if delays else None,
            "clock": self.taken[-1].clock if delays else None,
            "window": len(delays),
        }

    def bandwidth(self) -> Figures:
        """Return bytes per second and the sizes of samples; what wraps them is not counted."""
        sizes = [sample.size for sample in self.taken]
        if not sizes:
            return dict.fromkeys(("bytes_per_s", "mean", "min", "max")) | {"window": 0}
        past_s = (self.taken[-1].received_ns - self.taken[0].received_ns) / NS_PER_S
        return {
            # The first one opens the time that the others fill.
            "bytes_per_s": sum(sizes[1:]) / past_s if past_s else None,
            "mean": statistics.fmean(sizes),
            "min": min(sizes),
            "max": max(sizes),
            "window": len(sizes),
        }


def quantile(rising: list[float], part: float) -> float | None:
    """Return the value that ``part`` of them do not exceed."""
    return rising[min(len(rising) - 1, int(part * len(rising)))] if rising else None
