"""Polling: the queries that are due, and the answers that are missing. Pure.

A *steady* query (bumper, mileage) is sent at its rate with or without answers. Of any other kind
one query is open at a time: an answer that does not arrive within the timeout counts as missed and
halves that query's rate, down to a quarter; the first answer restores it. This limits the load of a
busy board, and recovers fast.

Answers carry no number, so an answer cannot be matched to its poll, and a lost answer looks like a
late one. Matching them in order hides losses: after one loss each answer counts for the previous
poll. Therefore the losses of a steady query count by *slots*, the times between two polls:

============================== ====================================================================
in a slot                      meaning
============================== ====================================================================
no answer                      the poll is lost, from the end of its slot on
one answer                     answered; with a constant delay it belongs to an earlier poll
another answer                 it was late: the oldest poll that was counted as lost within the
                               answer timeout no longer counts as lost
another answer, right behind   a copy of the first one: no loss is taken back
============================== ====================================================================

At 50 Hz a loss is detected 20 ms after its poll. A delay that grows by n periods counts as n losses
for the length of the window: the bumper state was unknown meanwhile. A slot ends with the next
poll, so a stalled process that does not poll counts no losses.
"""

from collections import deque
from collections.abc import Collection, Iterable

from msgspec import Struct

from common.freshness import NS_PER_S
from common.wire.frame import Frame

SLOWEST = 4  # maximum slowdown, in periods
WINDOW_NS = NS_PER_S // 5  # of ``lost``
COPY_PART = 8  # of a period; an answer this soon after another one is a copy


class Losses:
    """The lost polls of one query within a window."""

    def __init__(self, period_ns: int, timeout_ns: int, window_ns: int) -> None:
        self.total = 0
        self._copy_ns = period_ns // COPY_PART
        self._timeout_ns = timeout_ns
        self._window_ns = window_ns
        self._lost_ns: deque[int] = deque()  # when each slot without an answer ended
        self._answered = True  # no poll yet, so none is lost
        self._answer_ns: int | None = None  # the newest

    def on_poll(self, now_ns: int) -> None:
        """Record a poll, which ends the previous slot."""
        if not self._answered:
            self._lost_ns.append(now_ns)
            self.total += 1
            self._drop_expired(now_ns)
        # 1 equivalent mutant: None is as false as False.
        self._answered = False

    def on_answer(self, now_ns: int) -> None:
        """Record an answer."""
        before_ns, self._answer_ns = self._answer_ns, now_ns
        if not self._answered:
            self._answered = True
            return
        if before_ns is not None and now_ns - before_ns < self._copy_ns:
            return
        for index, lost_ns in enumerate(self._lost_ns):
            if now_ns - lost_ns <= self._timeout_ns:
                del self._lost_ns[index]
                self.total -= 1
                return

    def lost(self, now_ns: int) -> int:
        """Return how many polls were lost within the window."""
        self._drop_expired(now_ns)
        return len(self._lost_ns)

    def _drop_expired(self, now_ns: int) -> None:
        while self._lost_ns and now_ns - self._lost_ns[0] > self._window_ns:
            self._lost_ns.popleft()


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


class Polling:
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

        After an unsolicited answer this is the time of the answer.
        """
        query = self.queries[name]
        if query.slowdown > 1:
            query.slowdown = 1
            query.due_ns = min(query.due_ns, now_ns + query.period_ns)
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
