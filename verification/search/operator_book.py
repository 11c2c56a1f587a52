"""The oracle's book on an operator's calls at one safety service: what they may clear and move.

Limits are written down here a second time, from the safety case.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from t2.messages import Bumper, Direction, Motion, ResetRequest, SafetyState

CALL_AGE_S = 1.0
CREEP_MPS, CREEP_M = 0.1, 0.15
COAST_S = 0.4  # after a release moved the vehicle, a press surely belongs to it
LONGEST_STEP_S = 0.1
GOOD_SAMPLES = 3
ROUNDING = 2e-3
# What happens again within so many seconds is one occurrence.
AGAIN_S = {"driver": 2.5, "predecessor": 1.0}
ALIASES = {"driver": {"driver_left", "driver_right"}}


@dataclass(slots=True)
class OperatorBook:
    """States of one safety service that operators saw, and their calls."""

    beats: dict[int, int] = field(default_factory=dict)  # heartbeat: when it was sent
    names: dict[int, str] = field(default_factory=dict)  # of causes, by identity
    began: dict[str, int] = field(default_factory=dict)  # when the newest occurrence began
    seen: dict[str, int] = field(default_factory=dict)
    clears: int = GOOD_SAMPLES  # bumper samples since the last pressed one
    crept: float = 0.0  # m since the contact was latched
    moved: tuple[Direction, int] | None = None  # by a release, last: where and when
    forbidden: set[Direction] = field(default_factory=set)
    stepped_ns: int | None = None  # the last verdict, while a release moves
    speed: float = 0.0  # of that verdict

    def on_state(self, state: SafetyState, now_ns: int) -> None:
        """Record a state that operators can see."""
        self.beats[state.heartbeat] = now_ns
        self.names |= {cause.id: cause.name for cause in state.causes}

    def on_trip(self, name: str, now_ns: int) -> None:
        """Record a trip, repeated or new."""
        again_ns = round(AGAIN_S.get(name, 0.1) * NS_PER_S)
        if now_ns - self.seen.get(name, -again_ns - 1) > again_ns:
            self.began[name] = now_ns
        self.seen[name] = now_ns

    def on_bumper(self, sample: Bumper, is_new: bool, now_ns: int) -> bool:
        """Record a new press, and perhaps a forbidden direction; return whether it is one."""
        if not sample.pressed:
            self.clears += is_new
            return False
        if self.clears >= GOOD_SAMPLES:
            self.began["contact"] = now_ns
        is_press = self.clears > 0
        if is_press and self.moved and now_ns - self.moved[1] <= COAST_S * NS_PER_S:
            self.forbidden.add(self.moved[0])
        self.clears = 0
        return is_press

    def may_clear(self, request: ResetRequest, trip: str, now_ns: int) -> bool:
        """Return whether a reset may clear a trip: in time, seen before it was asked, and named."""
        sent_ns = self.beats.get(request.echo or 0)
        if sent_ns is None or now_ns - sent_ns > CALL_AGE_S * NS_PER_S:
            return False
        named = {self.names.get(one) for one in request.causes}
        return any(
            name in self.began
            and self.began[name] <= sent_ns
            and bool(ALIASES.get(name, {name}) & named)
            for name in (trip, "predecessor")
        )

    def on_cleared(self) -> None:
        """Record a cleared contact: a release has its full distance again."""
        self.crept, self.moved = 0.0, None
        self.forbidden.clear()

    def on_verdict(self, motion: Motion, creeps: bool, now_ns: int) -> None:
        """Add up the commanded travel of a release."""
        if self.stepped_ns is not None:
            self.crept += self.speed * min((now_ns - self.stepped_ns) / NS_PER_S, LONGEST_STEP_S)
        self.stepped_ns = None
        if creeps and motion.linear:
            self.stepped_ns, self.speed = now_ns, abs(motion.linear)
            self.moved = direction_of(motion), now_ns

    def complaints(self, motion: Motion) -> Iterator[str]:
        """Return why a release must not move the vehicle like this."""
        if abs(motion.linear) > CREEP_MPS + ROUNDING or motion.angular != 0:
            yield "a release that does not creep straight"
        if direction_of(motion) in self.forbidden:
            yield "a release in a direction in which the bumper was pressed"
        if self.crept > CREEP_M:
            yield "a release farther than its way"


def direction_of(motion: Motion) -> Direction:
    """Return the direction of a motion."""
    return "forward" if motion.linear > 0 else "backward"
