"""How late a key can be: a limit from questions that the terminal answers.

A key press carries no time, and a network or a stalled machine may hold it up. Teleop therefore
asks the terminal for its cursor's position all the time. The terminal's answers and its keys come
in one stream, so a key that comes after an answer was typed after that question was sent. A key
is at most as old as the newest question that was answered before it.

Keys that move the vehicle or reset a latch count in the last row only:

============================= ======================= ==================================
newest answer before the key  answers of the last 1 s keys
============================= ======================= ==================================
none                          none                    refused: the round trip is unknown
to a question older than      any                     refused: at least that slow
``limit`` + 2 questions
in time                       one took over the limit refused: that slow
in time                       all within the limit    count
============================= ======================= ==================================

A terminal multiplexer answers for itself: over ssh its answers do not measure the operator's
terminal, see ``multiplexer``.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from common.freshness import NS_PER_S

PROBE_S = 0.1  # between two questions
RECOVER_S = 1.0  # that the terminal must be fast before its keys count again
NUMBERS = 64  # distinct numbers of open questions: 6.4 s
ADVICE = "use `t2 drive` on a machine near the robot, or the dashboard"
UNKNOWN = "terminal delay unknown: no answer yet"

ANSWER_FOR_THEMSELVES = {"TMUX": "tmux", "STY": "screen", "ZELLIJ": "zellij"}
OVER_SSH = ("SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY")


@dataclass(frozen=True, slots=True)
class Answer:
    """A question that was answered."""

    sent_ns: int
    received_ns: int

    @property
    def took_ns(self) -> int:
        """How long it was on its way, there and back."""
        return self.received_ns - self.sent_ns


class RoundTrip:
    """Decides whether a key that was read at some moment counts."""

    def __init__(self, limit_s: float, unmeasurable: str = "") -> None:
        self._limit_ns = round(limit_s * NS_PER_S)
        self._unmeasurable = unmeasurable
        self._sent_ns: dict[int, int] = {}  # by number
        self._answers: deque[Answer] = deque(maxlen=NUMBERS)

    def sent(self, number: int, now_ns: int) -> None:
        """Note that a question went out."""
        self._sent_ns[number] = now_ns

    def answered(self, number: int, now_ns: int) -> None:
        """Note that a question's answer came in; an unknown one is ignored."""
        sent_ns = self._sent_ns.get(number)
        if sent_ns is not None:
            self._sent_ns = {one: at for one, at in self._sent_ns.items() if at > sent_ns}
            self._answers.append(Answer(sent_ns, now_ns))

    def refusal(self, at_ns: int) -> str:
        """Return why a key that came at this moment does not count, for a person; else empty."""
        if self._unmeasurable:
            return self._unmeasurable
        before = [answer for answer in self._answers if answer.received_ns <= at_ns]
        if not before:
            return UNKNOWN
        recent = [one.took_ns for one in before if at_ns - one.received_ns <= RECOVER_S * NS_PER_S]
        took_ns = max([self._least_ns(before[-1], at_ns), *recent])
        if took_ns <= self._limit_ns:
            return ""
        took_s, limit_s = took_ns / NS_PER_S, self._limit_ns / NS_PER_S
        return f"terminal too slow: {took_s:.2f} s, allowed {limit_s:g} s"

    @staticmethod
    def _least_ns(newest: Answer, at_ns: int) -> int:
        """Return how slow the terminal is at least, as it has not answered since."""
        return round(at_ns - newest.sent_ns - 2 * PROBE_S * NS_PER_S)


def multiplexer(environ: Mapping[str, str], ancestors: Iterable[str]) -> str:
    """Return which program answers in place of a terminal that is far away; empty if none."""
    if "mosh-server" in ancestors:
        return "mosh hides the terminal's delay"
    if any(name in environ for name in OVER_SSH):
        for name, program in ANSWER_FOR_THEMSELVES.items():
            if name in environ:
                return f"{program} over ssh hides the terminal's delay"
    return ""
