"""Statistics of a stream: rate and gaps, delay, bandwidth. Pure.

Figures cover the last ``window`` samples, as ``ros2 topic hz``, ``delay`` and ``bw`` do. ``lost``
counts gaps of ``seq`` since the start: published and not received. Units: seconds, bytes, hertz.
"""

import statistics
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise

from common.freshness import NS_PER_S

Figures = dict[str, float | int | str | None]


@dataclass(frozen=True, slots=True)
class StreamSample:
    """Measured values of one sample; ``delay_s`` is None without a timestamp."""

    received_ns: int
    size: int
    seq: int | None = None
    boot: int | None = None
    delay_s: float | None = None
    clock: str = ""  # of the delay: "host" or "wall"


@dataclass(slots=True)
class StreamStats:
    """Statistics of the last samples of one key."""

    window: int
    samples: deque[StreamSample] = field(default_factory=deque)
    count: int = 0
    lost: int = 0

    def add(self, sample: StreamSample) -> None:
        """Add a sample; drop the oldest one beyond the window."""
        before = self.samples[-1] if self.samples else None
        self.samples.append(sample)
        self.count += 1
        if len(self.samples) > self.window:
            self.samples.popleft()
        if before and before.boot == sample.boot and before.seq and sample.seq:
            self.lost += max(0, sample.seq - before.seq - 1)

    def rate(self) -> Figures:
        """Return the rate and the gaps between samples; None below two samples."""
        stamps = [sample.received_ns for sample in self.samples]
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
        """Return the transport delay; with wall clocks it includes their offset."""
        delays = sorted(each.delay_s for each in self.samples if each.delay_s is not None)
        return {
            "mean": statistics.fmean(delays) if delays else None,
            "min": delays[0] if delays else None,
            "p50": quantile(delays, 0.50),
            "p99": quantile(delays, 0.99),
            "max": delays[-1] if delays else None,
            "clock": self.samples[-1].clock if delays else None,
            "window": len(delays),
        }

    def bandwidth(self) -> Figures:
        """Return bytes per second and the sizes of samples, without protocol overhead."""
        sizes = [sample.size for sample in self.samples]
        if not sizes:
            return dict.fromkeys(("bytes_per_s", "mean", "min", "max")) | {"window": 0}
        span_s = (self.samples[-1].received_ns - self.samples[0].received_ns) / NS_PER_S
        return {
            # The first sample only starts the interval.
            "bytes_per_s": sum(sizes[1:]) / span_s if span_s else None,
            "mean": statistics.fmean(sizes),
            "min": min(sizes),
            "max": max(sizes),
            "window": len(sizes),
        }


def quantile(rising: list[float], part: float) -> float | None:
    """Return the quantile ``part`` (0 to 1) of sorted values."""
    return rising[min(len(rising) - 1, int(part * len(rising)))] if rising else None
