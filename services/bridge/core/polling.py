"""Polling: the queries that are due, and the answers that are missing. Pure.

Each query is sent at its rate, with or without answers. Answers carry no number, so an answer
cannot be matched to its poll, and a lost answer looks like a late one. Matching them in order hides
losses: after one loss each answer counts for the previous poll. Therefore losses count by *slots*,
the times between two polls:

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
from collections.abc import Iterable

from common.freshness import NS_PER_S
from common.wire.frame import Frame

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


class Query:
    """One query: when it is due, its newest round trip, and its lost polls."""

    def __init__(self, frame: Frame, rate_hz: float, timeout_ns: int, early_ns: int) -> None:
        """Set up; it may be sent ``early_ns`` before it is due."""
        self.frame = frame
        # 1 equivalent mutant: the first poll is long overdue in any case.
        self.due_ns = 0
        self.round_trip_ns: int | None = None
        self._period_ns = round(NS_PER_S / rate_hz)
        self.losses = Losses(self._period_ns, timeout_ns, WINDOW_NS)
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
        self.losses.on_poll(now_ns)
        return True

    def answered(self, now_ns: int) -> int:
        """Record an answer; return the time of its poll, or its own if it is unsolicited."""
        self.losses.on_answer(now_ns)
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

    def lost(self, name: str, now_ns: int) -> int:
        """Return how many polls of a query were lost within the last 0.2 s."""
        return self.queries[name].losses.lost(now_ns)

    def round_trip_s(self) -> float | None:
        """Return the median of the newest round trip of each query, in seconds."""
        trips = sorted(
            q.round_trip_ns for q in self.queries.values() if q.round_trip_ns is not None
        )
        return trips[len(trips) // 2] / NS_PER_S if trips else None

    def missed(self) -> dict[str, int]:
        """Return the number of lost polls, by query."""
        return {name: q.losses.total for name, q in self.queries.items() if q.losses.total}
