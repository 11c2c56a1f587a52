"""Age of a request without synchronized clocks, by the heartbeat number that it echoes.

Safety puts a rising number into each ``SafetyState``. A program that requests motion or makes an
operator's call echoes the newest number that it saw. Whoever sent or received that number knows on
its own clock when that was, so it knows how old the request can be at most. Numbers start at
random, so that echoes of an earlier start are unknown.
"""

from msgspec import Struct

from common.freshness import NS_PER_S

CAPACITY = 256  # at 20 states a second, and some at once: over 10 s, more than any limit needs


class Heartbeat(Struct, frozen=True):
    """The newest number, and when the last ones were sent (safety) or received (others)."""

    number: int = 0
    sent: tuple[tuple[int, int], ...] = ()  # number, local time in ns; the newest last

    def beat(self, now_ns: int) -> "Heartbeat":
        """Return it with a new number, sent now."""
        return self.noted(self.number + 1, now_ns)

    def noted(self, number: int, now_ns: int) -> "Heartbeat":
        """Return it with a number that was received now."""
        return Heartbeat(number, (*self.sent[-(CAPACITY - 1) :], (number, now_ns)))

    def is_late(self, echo: int, now_ns: int, max_age_ns: int) -> bool:
        """Return whether an echo is unknown or older than the limit."""
        age_ns = self._age_ns(echo, now_ns)
        return age_ns is None or age_ns > max_age_ns

    def refusal(self, echo: int | None, now_ns: int, max_age_ns: int) -> str:
        """Return why an operator's call with this echo is refused, for a person; empty if not."""
        if echo is None:
            return (
                "The call carries no echo of safety's heartbeat: send the newest "
                "SafetyState.heartbeat as `echo`."
            )
        age_ns = self._age_ns(echo, now_ns)
        if age_ns is None:
            return "The call echoes an unknown heartbeat of safety: look again, then repeat it."
        if age_ns > max_age_ns:
            age_s, limit_s = age_ns / NS_PER_S, max_age_ns / NS_PER_S
            return f"The call is {age_s:.1f} s old, allowed is {limit_s:g} s: repeat it."
        return ""

    def _age_ns(self, echo: int, now_ns: int) -> int | None:
        for number, sent_ns in reversed(self.sent):
            if number == echo:
                return now_ns - sent_ns
        return None
