"""How regularly a key came. Pure."""

from dataclasses import dataclass, field
from itertools import pairwise

from cli.inspect.addressing import topic_of
from cli.inspect.stream_stats import quantile
from common.messages import Message

MISSED = 3.0  # periods without a sample that make a gap


@dataclass(slots=True)
class Stream:
    """All samples of a key, by the time of their arrival in s."""

    key: str
    times: list[float] = field(default_factory=list)
    lost: int = 0  # numbers that are missing in ``seq``
    restarts: int = 0  # of its publisher
    unread: int = 0  # samples that are no message of ours
    _last: Message | None = None

    def take(self, at_s: float, message: Message | None) -> None:
        """Count a sample in."""
        self.times.append(at_s)
        if message is None:
            self.unread += 1
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
        """Return the rate as shipped, 0 for what comes when it happens."""
        topic = topic_of(self.key)
        return topic.rate_hz if topic else 0.0

    @property
    def hz(self) -> float | None:
        """Return the mean rate from the first sample to the last."""
        took_s = self.times[-1] - self.times[0] if self.times else 0.0
        return (len(self.times) - 1) / took_s if took_s > 0 else None

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Return from when to when it was missed, in s."""
        if not self.expected_hz:
            return []
        longest_s = MISSED / self.expected_hz
        return [(a, b) for a, b in pairwise(self.times) if b - a > longest_s]

    def pause_s(self, share: float) -> float | None:
        """Return the pause between two samples that this share of them does not exceed."""
        return quantile(sorted(b - a for a, b in pairwise(self.times)), share)
