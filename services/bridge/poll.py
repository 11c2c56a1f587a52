"""Which query is due and which answer is overdue.

One query of a kind is open at a time. An answer that does not come within the timeout counts as
missed and halves that query's rate, down to a quarter; the first answer restores it. A board that
is busy is so not flooded, and one that recovers is not kept waiting.
"""

from collections.abc import Iterable

from msgspec import Struct

from common.freshness import S
from common.wire.frame import Frame

SLOWEST = 4  # times the period


class Query(Struct):
    """One query and what became of it."""

    name: str
    frame: Frame
    period_ns: int
    due_ns: int = 0
    sent_ns: int | None = None  # when the open one was sent
    slowdown: int = 1
    missed: int = 0
    round_trip_ns: int | None = None


class Poll:
    """The queries of a board, each at its own rate."""

    def __init__(self, queries: Iterable[tuple[str, Frame, float]], timeout_s: float) -> None:
        """Take name, frame and rate in Hz of each query."""
        self.queries = {
            name: Query(name, frame, round(S / rate_hz)) for name, frame, rate_hz in queries
        }
        self._timeout_ns = round(timeout_s * S)

    def due(self, now_ns: int) -> list[Frame]:
        """Return the queries to send now."""
        return [query.frame for query in self.queries.values() if self._is_due(query, now_ns)]

    def answered(self, name: str, now_ns: int) -> int:
        """Take in an answer, and return when it was asked for: it is no older than that.

        One that nobody asked for changes nothing.
        """
        query = self.queries[name]
        query.slowdown = 1
        if query.sent_ns is None:
            return now_ns
        asked_ns, query.sent_ns = query.sent_ns, None
        query.round_trip_ns = now_ns - asked_ns
        return asked_ns

    def round_trip_s(self) -> float | None:
        """Return the median of the newest round trip of each query, in seconds."""
        trips = sorted(
            q.round_trip_ns for q in self.queries.values() if q.round_trip_ns is not None
        )
        return trips[len(trips) // 2] / S if trips else None

    def missed(self) -> dict[str, int]:
        """Return how many answers never came in time, by query."""
        return {query.name: query.missed for query in self.queries.values() if query.missed}

    def _is_due(self, query: Query, now_ns: int) -> bool:
        if query.sent_ns is not None:
            if now_ns - query.sent_ns < self._timeout_ns:
                return False
            query.sent_ns = None
            query.missed += 1
            query.slowdown = min(2 * query.slowdown, SLOWEST)
        if now_ns < query.due_ns:
            return False
        # Keep the beat while on time; after a pause begin a new one instead of catching up.
        period_ns = query.period_ns * query.slowdown
        late = now_ns - query.due_ns >= period_ns
        query.due_ns = now_ns + period_ns if late else query.due_ns + period_ns
        query.sent_ns = now_ns
        return True
