"""A limit on how long a gamepad drives without any event.

A gamepad that freezes while its USB dongle stays enumerated keeps its last state: the deadman stays
down, the stick stays deflected. SDL reports changes only, so silence alone is no fault:

========= ============ ================= ========================================
deadman   stick        events            gamepad
========= ============ ================= ========================================
up        any          any or none       moves nothing
down      at rest      any or none       requests zero, which is harmless
down      deflected    one within limit  drives
down      deflected    none for longer   released, until the deadman was let go
========= ============ ================= ========================================

A thumb on a deflected stick is never still: at 8 to 16 bits its tremor changes one of the two axes
many times a second. At the mechanical end one axis may be clamped, but the cross axis is not, and
every axis, hat and button counts. Full deflection is the fastest motion, so it gets no longer
limit; the screen asks for a movement after half of it.
"""

from common.freshness import NS_PER_S


class GamepadWatchdog:
    """How long a gamepad has sent nothing."""

    _events: int | None
    _event_ns: int

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self.update(None, 0)

    def update(self, events: int | None, now_ns: int) -> None:
        """Take the number of events so far; None without a gamepad."""
        if events is None or events != self._events:
            self._events, self._event_ns = events, now_ns

    def quiet_s(self, now_ns: int) -> float:
        """Return how long ago the last event was."""
        return (now_ns - self._event_ns) / NS_PER_S

    def is_due(self, now_ns: int) -> bool:
        """Return whether the operator should move the stick to keep driving."""
        return self.quiet_s(now_ns) > self._limit_s / 2

    def is_expired(self, now_ns: int) -> bool:
        """Return whether the gamepad may no longer drive."""
        return self.quiet_s(now_ns) > self._limit_s
