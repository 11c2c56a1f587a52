"""How many polls of a steady query the board did not answer lately.

Answers carry no number, so none can be matched to its poll, and a lost answer looks like one that
is late. Matching them in order hides losses: after one loss each answer is taken for that of the
poll before. Therefore the time between two polls, a *slot*, is judged, and not a poll:

============================== ====================================================================
in a slot                      meaning
============================== ====================================================================
no answer                      the poll is lost, from the end of its slot on
one answer                     answered; with a constant delay it is that of an earlier poll
another answer                 it was late: the oldest poll that was counted as lost within the
                               answer timeout no longer counts as lost
another answer, right behind   a copy of the first one: it takes no loss back
============================== ====================================================================

At 50 Hz a loss is known 20 ms after its poll. A delay that grows by n periods counts as n losses
for as long as the window: the bumper was unknown meanwhile. A slot ends with the next
poll, so a process that is held up and does not poll counts nothing.
"""

from collections import deque

COPY_PART = 8  # of a period; an answer that comes sooner behind another one is its copy


class Losses:
    """The lost polls of one query within a window."""

    def __init__(self, period_ns: int, timeout_ns: int, window_ns: int) -> None:
        self.total = 0
        self._copy_ns = period_ns // COPY_PART
        self._timeout_ns = timeout_ns
        self._window_ns = window_ns
        self._lost_ns: deque[int] = deque()  # when each slot without an answer ended
        self._answered = True  # no poll, none lost
        self._answer_ns: int | None = None  # the newest

    def on_poll(self, now_ns: int) -> None:
        """Take in that a poll is sent: the slot before it is over."""
        if not self._answered:
            self._lost_ns.append(now_ns)
            self.total += 1
            self._forget(now_ns)
        self._answered = False

    def on_answer(self, now_ns: int) -> None:
        """Take in an answer."""
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
        self._forget(now_ns)
        return len(self._lost_ns)

    def _forget(self, now_ns: int) -> None:
        while self._lost_ns and now_ns - self._lost_ns[0] > self._window_ns:
            self._lost_ns.popleft()
