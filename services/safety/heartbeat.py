"""How old a request can be at most, without synchronized clocks.

Each state that is published carries a number, and whoever drives echoes the newest one it saw. When
that number went out is known on our own clock. After a gap Zenoh delivers a burst of old requests;
their echoes give them away. Numbers start at random, so that echoes of an earlier life are unknown.
"""

from msgspec import Struct

CAPACITY = 256  # at 20 states a second, and some at once, far more than an age of 0.4 s needs


class Heartbeat(Struct, frozen=True):
    """The newest number, and when the last ones were sent."""

    number: int = 0
    sent: tuple[tuple[int, int], ...] = ()  # number, local time; the newest last

    def beat(self, now_ns: int) -> "Heartbeat":
        """Return it with a new number, sent now."""
        number = self.number + 1
        return Heartbeat(number, (*self.sent[-(CAPACITY - 1) :], (number, now_ns)))

    def is_late(self, echo: int, now_ns: int, max_age_ns: int) -> bool:
        """Tell whether an echo is unknown or was sent too long ago."""
        for number, sent_ns in reversed(self.sent):
            if number == echo:
                return now_ns - sent_ns > max_age_ns
        return True
