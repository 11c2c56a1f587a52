"""The viewers with a part in a robot's safety: the one that drives, and the page of the e-stop.

**Driver lock.** One viewer has the driver lock; the others watch. Another viewer takes it over with
``force``. A browser may hang, run in the background, or sit behind a network that delivers late. So
the browser answers each snapshot with the controls that it holds and with the heartbeat of safety
that it was shown. That heartbeat becomes the echo of the drive requests: safety refuses a late one.
Here a hold is valid only while that state of safety is younger than ``HOLD_S``:

========= ===================== =============================== ====================
state     hold, young state     hold, old or unknown state      no hold in time
========= ===================== =============================== ====================
FREE      HELD                  FREE, refused                   FREE
HELD      HELD                  HELD, refused                   LAPSED
LAPSED    LAPSED, refused       LAPSED, refused                 LAPSED
========= ===================== =============================== ====================

``let_go`` leads to FREE from any state. After a lapse it is required before the next hold: a hold
that returns after a gap is an old request.

**Keepalive.** A page that is open, visible and answers snapshots can keep the emergency stop alive.
One page holds it. When that page is hidden, closed or cut off, nothing is sent for it any more, and
safety brakes and latches. Another page takes over only after that: a change that nobody notices
would hide that the first operator is gone.
"""

from dataclasses import dataclass, field
from enum import Enum

from common.freshness import NS_PER_S, Latest, fresh
from common.motion import clamp
from t2.messages import Direction, SafetyState

HOLD_S = 0.35  # safety refuses an echo of over 0.4 s

Shown = Latest[SafetyState] | None  # the state that a browser answers; None if it is unknown


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

    driver: str | None = None  # a viewer
    name: str = ""  # of its operator, as typed on the page
    state: HoldState = HoldState.FREE
    push: Push = field(default_factory=Push)
    gear: int = 1
    in_sight: bool = False  # the driver sees the vehicle, and needs no picture of a camera
    shown: Shown = None  # the state that the newest valid hold answers

    def take(self, viewer: str, force: bool, name: str = "") -> bool:
        """Give the lock to a viewer, unless another one has it and ``force`` is not set."""
        if self.driver not in (None, viewer) and not force:
            return False
        if self.driver != viewer:
            self.driver, self.gear, self.in_sight = viewer, 1, False
            self.let_go()
        self.name = name
        return True

    def leave(self, viewer: str) -> None:
        """Free the lock if this viewer has it."""
        if self.driver == viewer:
            self.let_go()
            self.driver = None

    def hold(self, push: Push, shown: Shown, now_ns: int) -> None:
        """Handle the driver's hold in answer to a state of safety."""
        if self.state is not HoldState.LAPSED and fresh(shown, now_ns, HOLD_S):
            self.state, self.shown = HoldState.HELD, shown
            self.push = Push(clamp(push.linear, 1.0), clamp(push.angular, 1.0), push.release)

    def let_go(self) -> None:
        """End the driver's hold."""
        self.state, self.push = HoldState.FREE, Push()

    def lapse(self) -> None:
        """End the hold and require ``let_go`` before the next one."""
        if self.state is HoldState.HELD:
            self.state, self.push = HoldState.LAPSED, Push()

    def held(self, now_ns: int) -> Push | None:
        """Return the valid hold, or None; a hold whose state of safety is too old lapses."""
        if not fresh(self.shown, now_ns, HOLD_S):
            self.lapse()
        return self.push if self.state is HoldState.HELD else None


@dataclass
class PageKeepalive:
    """The page that keeps one robot's emergency stop alive on this dashboard."""

    name: str  # in safety.limits, with a silence that latches; empty: none
    holder: str | None = None  # a viewer
    _shown_ns: int = 0  # when the state was received that the holder answered last

    def answer(
        self, viewer: str, shown: Shown, newest: SafetyState | None, now_ns: int
    ) -> int | None:
        """Return the heartbeat to echo for a page's answer; None when it does not count."""
        known = newest.limit_sources if newest else ()
        ours = next((one for one in known if one.source == self.name), None)
        if ours is None or ours.silence != "latch" or shown is None:
            return None
        is_held = not ours.silent or now_ns - self._shown_ns <= ours.lease * NS_PER_S
        if viewer != self.holder and is_held:
            return None
        self.holder, self._shown_ns = viewer, shown.received_ns
        return shown.value.heartbeat

    def left(self, viewer: str) -> None:
        """Forget a page that is gone."""
        if self.holder == viewer:
            self.holder = None
