"""Regularity of a stream: rate, gaps and losses. Pure."""

from dataclasses import dataclass, field
from itertools import pairwise

from cli.inspect.addressing import topic_of
from cli.inspect.stream_stats import quantile
from common.messages import Message

MISSED = 3.0  # a gap is longer than this many periods


@dataclass(slots=True)
class Stream:
    """The samples of a key, by arrival time in s."""

    key: str
    times: list[float] = field(default_factory=list)
    lost: int = 0  # missing numbers in ``seq``
    restarts: int = 0  # of its publisher
    undecoded: int = 0  # samples that are not valid messages
    _last: Message | None = None

    def add(self, at_s: float, message: Message | None) -> None:
        """Count a sample."""
        self.times.append(at_s)
        if message is None:
            self.undecoded += 1
            return
        last, self._last = self._last, message
        if last is None:
            return
        if last.boot != message.boot:
            self.restarts += 1
        else:
            self.lost += max(0, message.seq - last.seq - 1)

    @property
    def expected_hz(self) -> float:
        """Return the nominal rate; 0 for an event-driven key."""
        topic = topic_of(self.key)
        return topic.rate_hz if topic else 0.0

    @property
    def hz(self) -> float | None:
        """Return the mean rate from the first to the last sample."""
        span_s = self.times[-1] - self.times[0] if self.times else 0.0
        return (len(self.times) - 1) / span_s if span_s > 0 else None

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Return begin and end of each gap, in s."""
        if not self.expected_hz:
            return []
        longest_s = MISSED / self.expected_hz
        return [(a, b) for a, b in pairwise(self.times) if b - a > longest_s]

    def interval_s(self, share: float) -> float | None:
        """Return a quantile of the interval between samples."""
        return quantile(sorted(b - a for a, b in pairwise(self.times)), share)
