"""Statistics of a stream: rate, gaps, losses, bandwidth, delay. Pure.

Figures cover the last ``WINDOW`` samples. ``lost`` counts gaps of ``seq`` since the start:
published and not received. Units: seconds, bytes, hertz.
"""

from collections import deque
from itertools import pairwise
from statistics import fmean
from typing import Any

from cli.inspect.payload import read
from common.codec import Sample
from common.freshness import NS_PER_S

WINDOW = 10_000


class StreamStats:
    """Statistics of one key; delays by the host's clock if the sender shares it."""

    def __init__(self, host: int = 0) -> None:
        self.count = 0
        self.lost = 0
        self.clock = ""  # of the delays: "host" or "wall"
        self._host = host
        self._sender: tuple[int, int] = (0, 0)  # boot and seq of the newest sample
        self._received: deque[tuple[int, int]] = deque(maxlen=WINDOW)  # time in ns, size
        self._delays_s: deque[float] = deque(maxlen=WINDOW)

    def add(self, sample: Sample) -> None:
        """Add a sample; its header is read, whatever its type."""
        self.count += 1
        self._received.append((sample.received_ns, sample.size))
        header = read(sample.payload, sample.encoding).value
        if not isinstance(header, dict):
            return
        numbers = {name: value for name, value in header.items() if isinstance(value, int)}
        before, self._sender = self._sender, (numbers.get("boot", 0), numbers.get("seq", 0))
        if before[1] and before[0] == self._sender[0]:
            self.lost += max(0, self._sender[1] - before[1] - 1)
        if numbers.get("mono_ns") and self._host and numbers.get("host") == self._host:
            self._delays_s.append((sample.received_ns - numbers["mono_ns"]) / NS_PER_S)
            self.clock = "host"
        elif numbers.get("t_ns"):
            self._delays_s.append((sample.wall_ns - numbers["t_ns"]) / NS_PER_S)
            self.clock = "wall"

    def rate_hz(self) -> float | None:
        """Return the rate; None below two samples."""
        span_s = self._span_s()
        return (len(self._received) - 1) / span_s if span_s else None

    def figures(self) -> dict[str, Any]:
        """Return all figures; None where samples are missing, or their timestamps."""
        stamps = [received_ns for received_ns, _ in self._received]
        gaps = [(later - earlier) / NS_PER_S for earlier, later in pairwise(stamps)]
        sizes = [size for _, size in self._received]
        delays, span_s = sorted(self._delays_s), self._span_s()
        return {
            "hz": self.rate_hz(),
            "gap_min": min(gaps, default=None),
            "gap_max": max(gaps, default=None),
            "lost": self.lost,
            # The first sample only starts the interval.
            "bytes_per_s": sum(sizes[1:]) / span_s if span_s else None,
            "bytes": fmean(sizes) if sizes else None,
            # With wall clocks it includes their offset.
            **{f"delay_{name}": quantile(delays, part) for name, part in PARTS.items()},
            "clock": self.clock or None,
        }

    def _span_s(self) -> float:
        if not self._received:
            return 0.0
        return (self._received[-1][0] - self._received[0][0]) / NS_PER_S


PARTS = {"p50": 0.50, "p99": 0.99, "max": 1.0}


def quantile(rising: list[float], part: float) -> float | None:
    """Return the quantile ``part`` (0 to 1) of sorted values."""
    return rising[min(len(rising) - 1, int(part * len(rising)))] if rising else None
