"""Age of a request without synchronized clocks, by the heartbeat number that it echoes.

Safety puts a rising number into each ``SafetyState``. A program that requests motion or makes an
operator's call echoes the newest number that it received. Whoever sent or received that number
knows the time by its own clock, and so the maximum age of the request. Numbers start at random, so
that echoes of an earlier start are unknown.
"""

from msgspec import Struct

from common.freshness import NS_PER_S
from t2.messages import Phrase, Phrases, SafetyState

MAX_CALL_AGE_NS = NS_PER_S  # of an operator's call
AHEAD = 20  # heartbeats (1 s) that a call may be ahead of the newest one received here
CAPACITY = 256  # at 20 states a second plus immediate ones: over 10 s, more than any limit


class Heartbeat(Struct, frozen=True):
    """The newest number, and when the last ones were sent (safety) or received (others)."""

    number: int = 0
    sent: tuple[tuple[int, int], ...] = ()  # number, local time in ns; the newest last

    def beat(self, now_ns: int) -> "Heartbeat":
        """Return the heartbeat with a new number, sent now."""
        return self.noted(self.number + 1, now_ns)

    def noted(self, number: int, now_ns: int) -> "Heartbeat":
        """Return the heartbeat with a number received now."""
        return Heartbeat(number, (*self.sent[-(CAPACITY - 1) :], (number, now_ns)))

    def is_late(self, echo: int, now_ns: int, max_age_ns: int) -> bool:
        """Return whether an echo is unknown or older than the limit."""
        age_ns = self.age_ns(echo, now_ns)
        return age_ns is None or age_ns > max_age_ns

    def refusal(self, echo: int | None, now_ns: int) -> Phrases:
        """Return why an operator's call with this echo is refused; empty if accepted."""
        if echo is None:
            return (Phrase("call.no_echo"),)
        age_ns = self.age_ns(echo, now_ns)
        if age_ns is None:
            return (Phrase("call.unknown_echo"),)
        if age_ns > MAX_CALL_AGE_NS:
            age_s, limit_s = age_ns / NS_PER_S, MAX_CALL_AGE_NS / NS_PER_S
            return (Phrase("call.late", {"age": age_s, "limit": limit_s}),)
        return ()

    def age_ns(self, echo: int, now_ns: int) -> int | None:
        """Return the time since a number was sent or received; None for an unknown one."""
        for number, sent_ns in reversed(self.sent):
            if number == echo:
                return now_ns - sent_ns
        return None


class Echoes(Struct, frozen=True):
    """Heartbeats of the running safety service, as another service received them."""

    boot: int = 0
    heartbeat: Heartbeat = Heartbeat()

    def received(self, state: SafetyState, now_ns: int) -> "Echoes":
        """Return the echoes with a state; those of an earlier start of safety are discarded."""
        heartbeat = self.heartbeat if state.boot == self.boot else Heartbeat()
        return Echoes(state.boot, heartbeat.noted(state.heartbeat, now_ns))

    def refusal(self, echo: int | None, now_ns: int) -> Phrases:
        """Return why a call with this echo is refused; empty if it is accepted.

        A state may reach the operator's program before it comes here: an echo slightly ahead
        counts as the newest number, and has its age.
        """
        newest = self.heartbeat.number
        if echo is not None and echo <= newest + AHEAD:
            echo = min(echo, newest)
        return self.heartbeat.refusal(echo, now_ns)
