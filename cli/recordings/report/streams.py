"""Regularity of the streams of a recording: rates, gaps and losses. Pure."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from cli.inspect.addressing import topic_of
from cli.inspect.stream_stats import quantile
from common import keys
from common.messages import Drive, Message

MISSED = 3.0  # a gap is longer than this many periods


@dataclass(slots=True)
class Publisher:
    """One process that published on a key, by the ``boot`` of its messages."""

    begins_s: float  # its first message
    ends_s: float  # its newest one
    last: Message


@dataclass(slots=True)
class Stream:
    """The samples of a key, by arrival time in s."""

    key: str
    times: list[float] = field(default_factory=list)
    lost: int = 0  # missing numbers in ``seq``
    undecoded: int = 0  # samples that are not valid messages
    _publishers: dict[int, Publisher] = field(default_factory=dict)  # by ``boot``
    _whole: set[int] = field(default_factory=set)  # after a silence on purpose

    def add(self, at_s: float, message: Message | None) -> None:
        """Count a sample; the emergency stop has no message."""
        self.times.append(at_s)
        if message is None:
            self.undecoded += not self.key.endswith(f"/{keys.ESTOP_PATH}")
            return
        publisher = self._publishers.get(message.boot)
        if publisher is None:
            self._publishers[message.boot] = Publisher(at_s, at_s, message)
            return
        last = publisher.last
        publisher.last, publisher.ends_s = message, at_s
        self.lost += max(0, message.seq - last.seq - 1)
        if message.seq == last.seq + 1 and _is_neutral(last):
            self._whole.add(len(self.times) - 1)

    @property
    def restarts(self) -> int:
        """Return how many publishers began after all earlier ones had ended."""
        return max(0, len(self._publishers) - self.concurrent - 1)

    @property
    def concurrent(self) -> int:
        """Return how many publishers began while an earlier one still published."""
        found, ends_s = 0, -math.inf
        for each in self._publishers.values():  # by their begin
            found += each.begins_s < ends_s
            ends_s = max(ends_s, each.ends_s)
        return found

    @property
    def expected_hz(self) -> float:
        """Return the nominal rate; 0 for an event-driven key."""
        topic = topic_of(self.key)
        return topic.rate_hz if topic else 0.0

    @property
    def hz(self) -> float | None:
        """Return the mean rate while the stream is not silent."""
        intervals = self._intervals
        span_s = sum(intervals)
        return len(intervals) / span_s if span_s > 0 else None

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Return begin and end of each gap, in s."""
        return [period for number, period in self._pauses() if number not in self._whole]

    @property
    def silences(self) -> list[tuple[float, float]]:
        """Return begin and end of each time, in s, in which a source had nothing to request."""
        return [period for number, period in self._pauses() if number in self._whole]

    def interval_s(self, share: float) -> float | None:
        """Return a quantile of the interval between samples, silences left out."""
        return quantile(sorted(self._intervals), share)

    @property
    def _intervals(self) -> list[float]:
        silences = set(self.silences)
        return [b - a for a, b in pairwise(self.times) if (a, b) not in silences]

    def _pauses(self) -> Iterator[tuple[int, tuple[float, float]]]:
        """Yield the intervals of more than three periods, with the number of the later sample."""
        longest_s = MISSED / self.expected_hz if self.expected_hz else math.inf
        for number, (a, b) in enumerate(pairwise(self.times), 1):
            if b - a > longest_s:
                yield number, (a, b)


def _is_neutral(message: Message) -> bool:
    """Return whether it is a request of zero: with it a source ends, and may be silent after it."""
    return isinstance(message, Drive) and message.linear == 0 == message.angular
