"""Who of the viewers drives, and whether what they hold still counts.

One viewer has the wheel; the others watch. To take it from somebody takes a second word, ``force``.

A browser may hang, be put in the background, or sit behind a network that delivers late. So a
hold is never taken on trust: every picture that goes out has a number, the browser answers each
with what is held, and the hold counts only while the picture that it answers to is younger than
the round trip that is allowed:

========= ===================== ============================== ====================
state     hold, young picture   hold, old or unknown picture   no hold in time
========= ===================== ============================== ====================
FREE      HELD                  FREE, refused                  FREE
HELD      HELD                  HELD, refused                  LAPSED
LAPSED    LAPSED, refused       LAPSED, refused                LAPSED
========= ===================== ============================== ====================

``let_go`` leads to FREE from everywhere. After a lapse it is wanted before a hold counts again:
what comes back after a gap is an old wish.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum

from common.codec import finite
from common.freshness import NS_PER_S
from common.messages import Direction
from common.motion import clamp

PICTURES = 64  # whose times are kept, 3 s of them; an older one is too old for any setting


class Grip(Enum):
    """What the driver's hand does."""

    FREE = "free"
    HELD = "held"
    LAPSED = "lapsed"


@dataclass(frozen=True, slots=True)
class Push:
    """How far the driver pushes, -1..1: forward and counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0
    release: Direction | None = None  # off a pressed bumper that way, instead of driving


@dataclass
class Wheel:
    """The one wheel of one robot on this dashboard."""

    round_trip_s: float
    driver: str | None = None  # a viewer
    grip: Grip = Grip.FREE
    push: Push = field(default_factory=Push)
    gear: int = 1
    answered: int = 0  # the newest picture that a hold answered to
    _sent: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=PICTURES))
    _seen_ns: int = 0  # when the newest picture that was answered had been sent

    def take(self, viewer: str, force: bool) -> bool:
        """Give the wheel to a viewer, unless another one has it and it is not forced."""
        if self.driver not in (None, viewer) and not force:
            return False
        if self.driver != viewer:
            self.driver, self.gear = viewer, 1
            self.let_go(viewer)
        return True

    def leave(self, viewer: str) -> None:
        """Take the wheel away from a viewer who leaves it, or who is gone."""
        if self.driver == viewer:
            self.let_go(viewer)
            self.driver = None

    def sent(self, picture: int, now_ns: int) -> None:
        """Note that a picture goes out to the viewers now."""
        self._sent.append((picture, now_ns))

    def hold(self, viewer: str, picture: int, push: Push, now_ns: int) -> bool:
        """Take what a browser holds in answer to a picture; tell whether it counts."""
        sent_ns = next((at_ns for number, at_ns in self._sent if number == picture), None)
        if viewer != self.driver or not finite(push.linear, push.angular) or sent_ns is None:
            return False
        if self.grip is Grip.LAPSED or now_ns - sent_ns > self.round_trip_s * NS_PER_S:
            return False
        if self.grip is Grip.HELD and sent_ns < self._seen_ns:
            return False  # overtaken by a newer one
        self.grip, self._seen_ns, self.answered = Grip.HELD, sent_ns, picture
        self.push = Push(clamp(push.linear, 1.0), clamp(push.angular, 1.0), push.release)
        return True

    def let_go(self, viewer: str) -> None:
        """Take the hand off the wheel."""
        if viewer == self.driver:
            self.grip, self.push = Grip.FREE, Push()

    def lapse(self) -> None:
        """Let go, and want it let go by hand, too."""
        if self.grip is Grip.HELD:
            self.grip, self.push = Grip.LAPSED, Push()

    def held(self, now_ns: int) -> Push | None:
        """Return what is held now; a hold whose round trip is overdue lapses."""
        if self.grip is Grip.HELD and now_ns - self._seen_ns > self.round_trip_s * NS_PER_S:
            self.lapse()
        return self.push if self.grip is Grip.HELD else None

    def shift(self, viewer: str, gear: int) -> None:
        """Change the gear."""
        if viewer == self.driver:
            self.gear = gear
