"""Hang detection: attempts to reach a router, and how many stay without an answer. Pure.

An attempt is a new session and one query. It has a deadline (``bus.probe_deadline``), and one
begins every half deadline, whatever the result of earlier ones. ``MISSES`` in a row mean a hang: a
single one may be a stall.

A hang is found a deadline and a half after the first attempt that meets it: within 2 s by default.
"""

MISSES = 2
STALL_NS = 500_000_000  # between two checks: the host stalled the probe and the router


class Attempts:
    """Counts the attempts without an answer."""

    def __init__(self, now_ns: int, deadline_ns: int) -> None:
        self._deadline_ns = deadline_ns
        self._due_ns = now_ns
        self._looked_ns = now_ns
        self._number = 0
        self._begun_ns: dict[int, int] = {}  # pending attempts, by number
        self._missed = 0
        self._forgiven = False

    def begin(self, now_ns: int) -> int | None:
        """Return the number of the attempt that begins now; None when none is due."""
        if now_ns < self._due_ns:
            return None
        self._due_ns = now_ns + self._deadline_ns // 2
        self._number += 1
        self._begun_ns[self._number] = now_ns
        return self._number

    def end(self, number: int, answered: bool) -> bool:
        """End an attempt; return whether it was answered in time."""
        if self._begun_ns.pop(number, None) is None:
            return False
        self._missed = 0 if answered else self._missed + 1
        if answered:
            self._forgiven = False
        return answered

    def hung(self, now_ns: int) -> bool:
        """Return whether the router hangs; call it more often than every ``STALL_NS``."""
        stalled = now_ns - self._looked_ns > STALL_NS
        self._looked_ns = now_ns
        if stalled and not self._forgiven:  # only once: a starved probe must still act
            self._forgiven = True
            self._missed = 0
            self._begun_ns.clear()
            return False
        begun = list(self._begun_ns.items())
        for number, begun_ns in begun:
            if now_ns - begun_ns >= self._deadline_ns:
                self.end(number, answered=False)
        return self._missed >= MISSES
