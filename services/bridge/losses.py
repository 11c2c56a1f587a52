"""Lost polls of a steady query.

Answers carry no number, so an answer cannot be matched to its poll, and a lost answer looks like a
late one. Matching them in order hides losses: after one loss each answer counts for the previous
poll. Therefore the time between two polls, a *slot*, is evaluated instead of a poll:

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
