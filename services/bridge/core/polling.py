"""Polling: the queries that are due, and the round trips of their answers. Pure.

Each query is sent at its rate, with or without answers. Answers carry no number, so an answer
cannot be matched to its poll, and a lost answer looks like a late one. How old a sample may be is
safety's decision, by the time since the one before (``bumper_age``).
"""

from collections.abc import Iterable

from common.freshness import NS_PER_S
from common.wire.frame import Frame


class Query:
    """One query: when it is due, and its newest round trip."""

    def __init__(self, frame: Frame, rate_hz: float, timeout_ns: int, early_ns: int) -> None:
        """Set up; it may be sent ``early_ns`` before it is due."""
        self.frame = frame
        self.due_ns = 0
        self.round_trip_ns: int | None = None
        self._period_ns = round(NS_PER_S / rate_hz)
        self._timeout_ns = timeout_ns
        self._early_ns = early_ns
        # Send time of the oldest poll that the next answer may belong to.
        self._sent_ns: int | None = None

    def poll(self, now_ns: int) -> bool:
        """Return whether it is due; then it counts as sent."""
        if now_ns + self._early_ns < self.due_ns:
            return False
        # Keep the period while on time; after a stall start a new one instead of catching up.
        late = now_ns - self.due_ns >= self._period_ns
        due_ns = (now_ns if late else self.due_ns) + self._period_ns
        # After a late poll, wait half a period at least: the answer needs that time.
        self.due_ns = max(due_ns, now_ns + self._period_ns // 2 + self._early_ns)
        if self._sent_ns is None or now_ns - self._sent_ns >= self._timeout_ns:
            self._sent_ns = now_ns
        return True

    def answered(self, now_ns: int) -> int:
        """Record an answer; return the time of its poll, or its own if it is unsolicited."""
        if self._sent_ns is None:
            return now_ns
        sent_ns, self._sent_ns = self._sent_ns, None
        self.round_trip_ns = now_ns - sent_ns
        return sent_ns


class Polling:
    """The queries of a board, each at its own rate."""

    def __init__(
        self, queries: Iterable[tuple[str, Frame, float]], timeout_s: float, tick_s: float = 0.0
    ) -> None:
        """Set up with name, frame and rate (Hz) of each query.

        ``tick_s``: the period at which ``due`` is called. A query is sent at the nearest tick.
        """
        timeout_ns, early_ns = round(timeout_s * NS_PER_S), round(tick_s * NS_PER_S) // 2
        self.queries = {
            name: Query(frame, rate_hz, timeout_ns, early_ns) for name, frame, rate_hz in queries
        }

    def due(self, now_ns: int) -> list[Frame]:
        """Return the queries to send now."""
        return [query.frame for query in self.queries.values() if query.poll(now_ns)]

    def answered(self, name: str, now_ns: int) -> int:
        """Record an answer; return the time of its query, which bounds its age."""
        return self.queries[name].answered(now_ns)

    def round_trip_s(self) -> float | None:
        """Return the median of the newest round trip of each query, in seconds."""
        trips = sorted(
            q.round_trip_ns for q in self.queries.values() if q.round_trip_ns is not None
        )
        return trips[len(trips) // 2] / NS_PER_S if trips else None
