"""Regularity of the streams of a recording: rates, gaps and losses. Pure."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

from cli.inspect.addressing import chunks, topic_of
from common import keys
from common.messages import Message

MISSED = 3.0  # a gap is longer than this many periods


@dataclass(slots=True)
class Stream:
    """The samples of a key, by arrival time in s."""

    key: str
    kind: str = ""  # the name of its message type; empty for a type unknown to T2
    times: list[float] = field(default_factory=list)
    lost: int = 0  # missing numbers in ``seq``
    undecoded: int = 0  # samples that are not valid messages
    _last_seq: dict[int, int] = field(default_factory=dict)  # by ``boot``

    def add(self, at_s: float, message: Message | None) -> None:
        """Count a sample; the emergency stop has no message."""
        self.times.append(at_s)
        if message is None:
            self.undecoded += chunks(self.key)[1] != keys.ESTOP_PATH
            return
        last = self._last_seq.get(message.boot, message.seq - 1)
        self.lost += max(0, message.seq - last - 1)
        self._last_seq[message.boot] = message.seq

    @property
    def publishers(self) -> int:
        """Return how many processes published on it, one after another or at the same time."""
        return len(self._last_seq)

    @property
    def expected_hz(self) -> float:
        """Return the nominal rate; 0 for an event-driven key, also of a source that may pause."""
        topic = topic_of(self.key)
        return topic.rate_hz if topic and topic is not keys.DRIVE else 0.0

    @property
    def hz(self) -> float | None:
        """Return the mean rate."""
        span_s = self.times[-1] - self.times[0]
        return (len(self.times) - 1) / span_s if span_s > 0 else None

    @property
    def longest(self) -> tuple[float, float]:
        """Return begin and end of the longest interval between two samples, in s."""
        return max(pairwise(self.times), key=lambda each: each[1] - each[0], default=(0.0, 0.0))

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Return begin and end of each gap, in s."""
        limit_s = MISSED / self.expected_hz if self.expected_hz else math.inf
        return [(a, b) for a, b in pairwise(self.times) if b - a > limit_s]
