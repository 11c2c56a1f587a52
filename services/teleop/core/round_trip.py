"""Round trip of the terminal: an upper bound for the age of a keystroke.

A keystroke carries no time stamp, and a network or a stalled host may delay it. Teleop therefore
queries the terminal's cursor position periodically. Answers and keystrokes come in one ordered
stream, so a keystroke that follows an answer was typed after that query was sent. It is at most as
old as the newest query that was answered before it.

Each query moves the cursor to another place, which identifies its answer. Places repeat after
minutes (80 x 24: 3 minutes), so a slow answer is not taken for that of a later query.

Keystrokes that move the vehicle or reset a latch are accepted in the last row only:

============================= ======================= ==================================
newest answer before it       answers of the last 1 s keystrokes
============================= ======================= ==================================
none                          none                    refused: the round trip is unknown
to a query older than         any                     refused: too slow
``limit`` + 2 query periods
in time                       one over the limit      refused: too slow
in time                       all within the limit    accepted
============================= ======================= ==================================

A terminal that answered once and then not for ``STOPPED_S`` shows nothing any more, although the
program goes on drawing: it is suspended, or its connection is cut.

A terminal multiplexer (tmux, screen, mosh) answers the query itself: over ssh its answers do not
measure the operator's terminal.
"""

from collections import deque
from dataclasses import dataclass

from common.freshness import NS_PER_S
from t2.messages import Phrase, Phrases

QUERY_S = 0.1  # period of the queries
RECOVER_S = 1.0  # that the terminal must be fast before its keystrokes count again
STOPPED_S = 1.0  # without an answer
ANSWERS = 64  # stored: 6.4 s
UNKNOWN = (Phrase("terminal.unknown"),)

Place = tuple[int, int]  # of the cursor: column and row, from 0


def place(query: int, width: int, height: int) -> Place:
    """Return the place of a query; not in the top row, whose answers look like an F3 key."""
    row, column = divmod(query, max(1, width))
    return column, 1 + row % max(1, height - 1)


@dataclass(frozen=True, slots=True)
class Answer:
    """A query with its answer."""

    sent_ns: int
    received_ns: int

    @property
    def round_trip_ns(self) -> int:
        """The round trip."""
        return self.received_ns - self.sent_ns


class RoundTrip:
    """Decides whether a keystroke that was read at a given time is accepted."""

    def __init__(self, limit_s: float) -> None:
        self._limit_ns = round(limit_s * NS_PER_S)
        self._sent_ns: dict[Place, int] = {}
        self._answers: deque[Answer] = deque(maxlen=ANSWERS)

    def sent(self, where: Place, now_ns: int) -> None:
        """Note that a query was sent."""
        self._sent_ns[where] = now_ns

    def answered(self, where: Place, now_ns: int) -> None:
        """Note the answer to a query; an unknown one is ignored."""
        sent_ns = self._sent_ns.get(where)
        if sent_ns is not None:
            self._sent_ns = {one: at for one, at in self._sent_ns.items() if at > sent_ns}
            self._answers.append(Answer(sent_ns, now_ns))

    def refusal(self, at_ns: int) -> Phrases:
        """Return why a keystroke that was read at this time is refused; empty if accepted."""
        before = [answer for answer in self._answers if answer.received_ns <= at_ns]
        if not before:
            return UNKNOWN
        recent = [
            one.round_trip_ns for one in before if at_ns - one.received_ns <= RECOVER_S * NS_PER_S
        ]
        round_trip_ns = max([self._least_ns(before[-1], at_ns), *recent])
        if round_trip_ns <= self._limit_ns:
            return ()
        delay_s, limit_s = round_trip_ns / NS_PER_S, self._limit_ns / NS_PER_S
        return (Phrase("terminal.slow", {"delay": delay_s, "limit": limit_s}),)

    def has_stopped(self, now_ns: int) -> bool:
        """Return whether the terminal answers no more; one that never answered has not."""
        newest = self._answers[-1] if self._answers else None
        return newest is not None and now_ns - newest.received_ns > STOPPED_S * NS_PER_S

    @staticmethod
    def _least_ns(newest: Answer, at_ns: int) -> int:
        """Return a lower bound of the round trip from the time since the newest answered query."""
        return round(at_ns - newest.sent_ns - 2 * QUERY_S * NS_PER_S)
