"""Statistics of a stream: rate, gaps, losses, bandwidth, delay. Pure.

Figures cover the last ``window`` samples, as ``ros2 topic hz`` does. ``lost`` counts gaps of
``seq`` since the start: published and not received. Units: seconds, bytes, hertz.
"""

import statistics
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from cli.inspect.payload import read
from common.codec import Sample
from common.freshness import NS_PER_S


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

    def rate_hz(self) -> float | None:
        """Return the rate; None below two samples."""
        span_s = self._span_s()
        return (len(self.samples) - 1) / span_s if span_s else None

    def figures(self) -> dict[str, Any]:
        """Return all figures; None where samples are missing, or their timestamps."""
        stamps = [sample.received_ns for sample in self.samples]
        gaps = [(later - earlier) / NS_PER_S for earlier, later in pairwise(stamps)]
        sizes = [sample.size for sample in self.samples]
        delays = sorted(each.delay_s for each in self.samples if each.delay_s is not None)
        span_s = self._span_s()
        return {
            "hz": self.rate_hz(),
            "gap": {
                "min": min(gaps, default=None),
                "max": max(gaps, default=None),
                "std_dev": statistics.pstdev(gaps) if gaps else None,
            },
            "lost": self.lost,
            # The first sample only starts the interval.
            "bytes_per_s": sum(sizes[1:]) / span_s if span_s else None,
            "bytes": statistics.fmean(sizes) if sizes else None,
            # With wall clocks it includes their offset.
            "delay": {
                "min": delays[0] if delays else None,
                "p50": quantile(delays, 0.50),
                "p99": quantile(delays, 0.99),
                "max": delays[-1] if delays else None,
            },
            "clock": self.samples[-1].clock if delays else None,
            "window": len(sizes),
        }

    def _span_s(self) -> float:
        if not self.samples:
            return 0.0
        return (self.samples[-1].received_ns - self.samples[0].received_ns) / NS_PER_S


def stream_sample(sample: Sample, host: int) -> StreamSample:
    """Return the measured values of a sample; its header is read, whatever its type."""
    header = read(sample.payload, sample.encoding).value
    if not isinstance(header, dict):
        return StreamSample(sample.received_ns, sample.size)
    numbers = {name: value for name, value in header.items() if isinstance(value, int)}
    delay_s, clock = None, ""
    if numbers.get("mono_ns") and host and numbers.get("host") == host:
        delay_s, clock = (sample.received_ns - numbers["mono_ns"]) / NS_PER_S, "host"
    elif numbers.get("t_ns"):
        delay_s, clock = (sample.wall_ns - numbers["t_ns"]) / NS_PER_S, "wall"
    seq, boot = numbers.get("seq"), numbers.get("boot")
    return StreamSample(sample.received_ns, sample.size, seq, boot, delay_s, clock)


def quantile(rising: list[float], part: float) -> float | None:
    """Return the quantile ``part`` (0 to 1) of sorted values."""
    return rising[min(len(rising) - 1, int(part * len(rising)))] if rising else None
