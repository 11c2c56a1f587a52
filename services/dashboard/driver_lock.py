"""The driver lock: which viewer drives a robot, and whether its hold is still valid.

One viewer has the driver lock; the others watch. Another viewer takes it over with ``force``.

A browser may hang, run in the background, or sit behind a network that delivers late. So every
snapshot that is sent has a number, and the browser answers each one with the controls that it
holds. A hold is valid only while the snapshot that it answers is younger than the allowed round
trip:

========= ===================== =============================== ====================
state     hold, young snapshot  hold, old or unknown snapshot   no hold in time
========= ===================== =============================== ====================
FREE      HELD                  FREE, refused                   FREE
HELD      HELD                  HELD, refused                   LAPSED
LAPSED    LAPSED, refused       LAPSED, refused                 LAPSED
========= ===================== =============================== ====================

``let_go`` leads to FREE from any state. After a lapse it is required before the next hold: a hold
that returns after a gap is an old request.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum

from common.codec import finite
from common.freshness import NS_PER_S
from common.messages import Direction, SafetyState
from common.motion import clamp

SNAPSHOTS_KEPT = 64  # 3 s; an older one is too old for any setting


class HoldState(Enum):
    """The state of the driver's hold."""

    FREE = "free"
    HELD = "held"
    LAPSED = "lapsed"


@dataclass(frozen=True, slots=True)
class Push:
    """The driver's deflection, -1..1: forward and counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0
    release: Direction | None = None  # off a pressed bumper in this direction, instead of driving


@dataclass
class DriverLock:
    """The driver lock of one robot on this dashboard."""

    round_trip_s: float
    driver: str | None = None  # a viewer
    state: HoldState = HoldState.FREE
    push: Push = field(default_factory=Push)
    gear: int = 1
    answered: int = 0  # the newest snapshot that a hold answered
    _sent: deque[tuple[int, int, SafetyState | None]] = field(
        default_factory=lambda: deque(maxlen=SNAPSHOTS_KEPT)
    )
    _answered_ns: int = 0  # when the newest answered snapshot was sent

    def take(self, viewer: str, force: bool) -> bool:
        """Give the lock to a viewer, unless another one has it and ``force`` is not set."""
        if self.driver not in (None, viewer) and not force:
            return False
        if self.driver != viewer:
            self.driver, self.gear = viewer, 1
            self.let_go(viewer)
        return True

    def leave(self, viewer: str) -> None:
        """Free the lock if this viewer has it."""
        if self.driver == viewer:
            self.let_go(viewer)
            self.driver = None

    def sent(self, number: int, now_ns: int, state: SafetyState | None = None) -> None:
        """Note that a snapshot with this state of safety is sent to the viewers now."""
        self._sent.append((number, now_ns, state))

    def seen(self, number: int, now_ns: int, limit_s: float) -> SafetyState | None:
        """Return safety's state in a snapshot; None if it is unknown, too old or had none.

        A reset, a switch and a release answer a snapshot by its number. The call carries the echo
        and the causes of that snapshot, so that a delayed click has no effect on anything newer.
        """
        known = (sent for sent in self._sent if sent[0] == number)
        _, sent_ns, state = next(known, (number, 0, None))
        return state if now_ns - sent_ns <= limit_s * NS_PER_S else None

    def hold(self, viewer: str, snapshot: int, push: Push, now_ns: int) -> bool:
        """Handle a browser's hold in answer to a snapshot; return whether it is valid."""
        sent_ns = next((at_ns for number, at_ns, _ in self._sent if number == snapshot), None)
        if viewer != self.driver or not finite(push.linear, push.angular) or sent_ns is None:
            return False
        if self.state is HoldState.LAPSED or now_ns - sent_ns > self.round_trip_s * NS_PER_S:
            return False
        if self.state is HoldState.HELD and sent_ns < self._answered_ns:
            return False  # reordered: a newer one was received before
        self.state, self._answered_ns, self.answered = HoldState.HELD, sent_ns, snapshot
        self.push = Push(clamp(push.linear, 1.0), clamp(push.angular, 1.0), push.release)
        return True

    def let_go(self, viewer: str) -> None:
        """End the driver's hold."""
        if viewer == self.driver:
            self.state, self.push = HoldState.FREE, Push()

    def lapse(self) -> None:
        """End the hold and require ``let_go`` before the next one."""
        if self.state is HoldState.HELD:
            self.state, self.push = HoldState.LAPSED, Push()

    def held(self, now_ns: int) -> Push | None:
        """Return the valid hold, or None; a hold whose round trip is overdue lapses."""
        if self.state is HoldState.HELD and (
            now_ns - self._answered_ns > self.round_trip_s * NS_PER_S
        ):
            self.lapse()
        return self.push if self.state is HoldState.HELD else None

    def shift(self, viewer: str, gear: int) -> None:
        """Change the gear, as the driver."""
        if viewer == self.driver:
            self.gear = gear
