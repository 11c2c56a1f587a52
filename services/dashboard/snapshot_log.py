"""Snapshots that were sent to browsers: what an operator saw when they pressed a button.

A reset, a switch and a release answer a snapshot by its number. The robot's service gets the echo
and the causes of that very snapshot, so that a button that a proxy delivered late acts on nothing
that came after it.
"""

from collections import deque
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from common.messages import SafetyState

KEPT = 64  # at 20 a second: 3 s, more than any round trip that is allowed


@dataclass
class Snapshots:
    """The last snapshots of one robot, with safety's state in each."""

    _sent: deque[tuple[int, int, SafetyState | None]] = field(
        default_factory=lambda: deque(maxlen=KEPT)
    )

    def sent(self, number: int, state: SafetyState | None, now_ns: int) -> None:
        """Note that a snapshot goes out now."""
        self._sent.append((number, now_ns, state))

    def seen(self, number: int, now_ns: int, limit_s: float) -> SafetyState | None:
        """Return safety's state in a snapshot; None if it is unknown, too old or had none."""
        for known, sent_ns, state in reversed(self._sent):
            if known == number:
                return state if now_ns - sent_ns <= limit_s * NS_PER_S else None
        return None
