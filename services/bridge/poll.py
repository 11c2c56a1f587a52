"""Poll scheduling: queries that are due, and overdue answers.

A *steady* query (bumper, mileage) is sent at its rate with or without answers; ``losses`` counts
its losses. Of any other kind one query is open at a time: an answer that does not arrive within the
timeout counts as missed and halves that query's rate, down to a quarter; the first answer restores
it. This limits the load of a busy board, and recovers fast.
"""

from collections.abc import Collection, Iterable

from msgspec import Struct

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from services.bridge.losses import Losses

SLOWEST = 4  # maximum slowdown, in periods
WINDOW_NS = NS_PER_S // 5  # of ``lost``


class Query(Struct):
    """One query and its state."""

    name: str
    frame: Frame
    period_ns: int
    due_ns: int = 0
    sent_ns: int | None = None  # send time of the oldest poll that the next answer may belong to
    slowdown: int = 1
    missed: int = 0
    round_trip_ns: int | None = None
    losses: Losses | None = None  # of a steady query


class Poll:
    """The queries of a board, each at its own rate."""

    def __init__(
        self,
        queries: Iterable[tuple[str, Frame, float]],
        timeout_s: float,
        steady: Collection[str] = (),
        tick_s: float = 0.0,
    ) -> None:
        """Set up with name, frame and rate (Hz) of each query, and the names of the steady ones.

        ``tick_s``: the period at which ``due`` is called. A query is sent at the nearest tick.
        """
        self._early_ns = round(tick_s * NS_PER_S) // 2
        self.queries = {
            name: Query(name, frame, round(NS_PER_S / rate_hz)) for name, frame, rate_hz in queries
        }
        self._timeout_ns = round(timeout_s * NS_PER_S)
        for name in steady:
            query = self.queries[name]
            query.losses = Losses(query.period_ns, self._timeout_ns, WINDOW_NS)

    def due(self, now_ns: int) -> list[Frame]:
        """Return the queries to send now."""
        return [query.frame for query in self.queries.values() if self._is_due(query, now_ns)]

    def answered(self, name: str, now_ns: int) -> int:
        """Record an answer; return the time of its query, which bounds its age.

        An unsolicited answer changes nothing.
        """
        query = self.queries[name]
        query.slowdown = 1
        if query.losses is not None:
            query.losses.on_answer(now_ns)
        if query.sent_ns is None:
            return now_ns
        asked_ns, query.sent_ns = query.sent_ns, None
        query.round_trip_ns = now_ns - asked_ns
        return asked_ns

    def lost(self, name: str, now_ns: int) -> int:
        """Return how many polls of a steady query were lost within the last 0.2 s."""
        losses = self.queries[name].losses
        return losses.lost(now_ns) if losses is not None else 0

    def round_trip_s(self) -> float | None:
        """Return the median of the newest round trip of each query, in seconds."""
        trips = sorted(
            q.round_trip_ns for q in self.queries.values() if q.round_trip_ns is not None
        )
        return trips[len(trips) // 2] / NS_PER_S if trips else None

    def missed(self) -> dict[str, int]:
        """Return the number of missed answers, by query."""
        counts = {
            query.name: query.missed if query.losses is None else query.losses.total
            for query in self.queries.values()
        }
        return {name: count for name, count in counts.items() if count}

    def _is_due(self, query: Query, now_ns: int) -> bool:
        if query.losses is None and query.sent_ns is not None:
            if now_ns - query.sent_ns < self._timeout_ns:
                return False
            query.sent_ns = None
            query.missed += 1
            query.slowdown = min(2 * query.slowdown, SLOWEST)
        if now_ns + self._early_ns < query.due_ns:
            return False
        # Keep the period while on time; after a stall start a new one instead of catching up.
        period_ns = query.period_ns * query.slowdown
        late = now_ns - query.due_ns >= period_ns
        query.due_ns = now_ns + period_ns if late else query.due_ns + period_ns
        if query.sent_ns is None or now_ns - query.sent_ns >= self._timeout_ns:
            query.sent_ns = now_ns
        if query.losses is not None:
            query.losses.on_poll(now_ns)
            # After a late poll, wait half a period at least: the answer needs that time.
            query.due_ns = max(query.due_ns, now_ns + period_ns // 2 + self._early_ns)
        return True
