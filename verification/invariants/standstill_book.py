"""The oracle's book on standstill: how far the vehicle rolls while it is to stand.

As in ``safety_book.py``, nothing is taken from the code under test.
"""

from dataclasses import dataclass

from common.freshness import NS_PER_S
from common.messages import Motion, Velocity

BRAKING_MPS2, BRAKING_RADPS2, GRACE_S = 0.6, 1.0, 0.5
FASTEST_MPS = 1.0
STANDING_MPS, STANDING_RADPS = 0.02, 0.05
AWAY = 0.05  # m or rad that a standing vehicle may be moved
# Two samples and a decision later at 1.5 m/s, and what the oracle counts more generously.
SLACK = 0.10
SLACK_S = 0.06
GAP_S = 0.1
FRESH_S = 0.2


@dataclass(slots=True)
class StandstillBook:
    """The velocities that one safety service received, and when it last commanded motion."""

    stop_ns: int = 0  # when standstill was commanded
    due_ns: int | None = None  # when the vehicle must stand; None while motion is commanded
    newest: Velocity | None = None
    newest_ns: int = 0
    rolled: float = 0.0  # m or rad, the larger, since standstill was last commanded

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Take a velocity in."""
        if rolls(velocity):
            gap_s = min((now_ns - self.newest_ns) / NS_PER_S, GAP_S)
            before = self.newest is not None and rolls(self.newest)
            self.rolled += max(abs(velocity.linear), abs(velocity.angular)) * gap_s * before
        else:
            self.rolled = 0.0
        if self.due_ns is not None and not self._known(now_ns):  # the first one after a gap
            self.due_ns = min(self.due_ns, now_ns + round(stopping_s(velocity) * NS_PER_S))
        self.newest, self.newest_ns = velocity, now_ns

    def _known(self, now_ns: int) -> bool:
        """Return whether the velocity is known; an unknown one counts as the highest."""
        return now_ns - self.newest_ns <= FRESH_S * NS_PER_S

    def complaint(self, motion: Motion, moves: bool, now_ns: int) -> str:
        """Return what is wrong with a motion that does not brake; empty if nothing is."""
        if moves:
            self.due_ns = None
            return ""
        if self.due_ns is None:
            self.stop_ns = self.due_ns = now_ns
        if now_ns - self.stop_ns <= GAP_S * NS_PER_S:  # the speed at STOP may be measured later
            speed = self.newest if self._known(now_ns) else None
            by_ns = self.stop_ns + round(stopping_s(speed) * NS_PER_S)
            self.due_ns = max(self.due_ns, by_ns)
        late_s = (now_ns - self.due_ns) / NS_PER_S
        if motion.command == "brake" or late_s < SLACK_S or not self._known(now_ns):
            return ""
        rolled = self.rolled > AWAY + SLACK
        return f"safety: no BRAKE while the vehicle rolls {self.rolled:.2f}" if rolled else ""


def rolls(velocity: Velocity) -> bool:
    """Return whether a velocity is a motion."""
    return abs(velocity.linear) >= STANDING_MPS or abs(velocity.angular) >= STANDING_RADPS


def stopping_s(velocity: Velocity | None) -> float:
    """Return how long stopping may take from this velocity."""
    if velocity is None:
        return FASTEST_MPS / BRAKING_MPS2 + GRACE_S
    linear, angular = abs(velocity.linear), abs(velocity.angular)
    return max(linear / BRAKING_MPS2, angular / BRAKING_RADPS2) + GRACE_S
