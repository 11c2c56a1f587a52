"""The oracle's book on an operator's calls at one safety service: what they may clear and move.

Limits are written down here a second time, from the safety case.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from common.messages import Bumper, Direction, Motion, ReleaseRequest, ResetRequest, SafetyState

CALL_AGE_S, ECHO_AGE_S, HOLD_S = 1.0, 0.4, 0.3
CREEP_MPS, CREEP_M = 0.1, 0.15
COAST_S = 0.4  # after a release moved the vehicle, a press surely belongs to it
LONGEST_STEP_S = 0.1
GOOD_SAMPLES = 3
ROUNDING = 2e-3
# What happens again within so many seconds is one occurrence.
AGAIN_S = {"driver": 2.5, "predecessor": 1.0}
ALIASES = {"driver": {"driver_left", "driver_right"}}

Hold = tuple[Direction, int]  # the direction, and when


@dataclass(slots=True)
class OperatorBook:
    """States of one safety service that operators saw, and their calls."""

    beats: dict[int, int] = field(default_factory=dict)  # heartbeat: when it was sent
    names: dict[int, str] = field(default_factory=dict)  # of causes, by identity
    began: dict[str, int] = field(default_factory=dict)  # when the newest occurrence began
    seen: dict[str, int] = field(default_factory=dict)
    hold: Hold | None = None  # granted last
    held_before: Hold | None = None  # the last call
    clears: int = GOOD_SAMPLES  # bumper samples since the last pressed one
    crept: float = 0.0  # m since the contact was latched
    moved: Hold | None = None  # by a release, last
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

    def on_bumper(self, sample: Bumper, is_new: bool, now_ns: int) -> None:
        """Record a new press: an occurrence, and perhaps a forbidden direction."""
        if not sample.pressed:
            self.clears += is_new
            return
        if self.clears >= GOOD_SAMPLES:
            self.began["contact"] = now_ns
        if self.clears:
            self.hold = None
            if self.moved and now_ns - self.moved[1] <= COAST_S * NS_PER_S:
                self.forbidden.add(self.moved[0])
        self.clears = 0

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
        self.crept, self.moved, self.hold = 0.0, None, None
        self.forbidden.clear()

    def on_hold(self, request: ReleaseRequest, now_ns: int) -> None:
        """Record a call that may be granted."""
        self.held_before = self.hold
        sent_ns = self.beats.get(request.echo or 0)
        if not request.held:
            self.hold = None
        elif (
            request.direction and sent_ns is not None and now_ns - sent_ns <= ECHO_AGE_S * NS_PER_S
        ):
            self.hold = request.direction, now_ns

    def on_verdict(self, motion: Motion, now_ns: int) -> None:
        """Add up the commanded travel of a release."""
        if self.stepped_ns is not None:
            self.crept += self.speed * min((now_ns - self.stepped_ns) / NS_PER_S, LONGEST_STEP_S)
        self.stepped_ns = None
        if motion.command == "run" and motion.source == "release" and motion.linear:
            self.stepped_ns, self.speed = now_ns, abs(motion.linear)
            self.moved = direction_of(motion), now_ns

    def complaints(self, motion: Motion, now_ns: int) -> Iterator[str]:
        """Return why a release must not move the vehicle like this."""
        if self.hold is None or now_ns - self.hold[1] > HOLD_S * NS_PER_S:
            yield "no operator holds the release"
        elif direction_of(motion) != self.hold[0]:
            yield "a release the other way than the operator chose"
        if abs(motion.linear) > CREEP_MPS + ROUNDING or motion.angular != 0:
            yield "a release that does not creep straight"
        if direction_of(motion) in self.forbidden:
            yield "a release in a direction in which the bumper was pressed"
        if self.crept > CREEP_M:
            yield "a release farther than its way"


def direction_of(motion: Motion) -> Direction:
    """Return the direction of a motion."""
    return "forward" if motion.linear > 0 else "backward"
