"""Motion watch: the vehicle moves as commanded, stops on command, and stays at that place.

**Runaway**, for each axis: after a slower command the vehicle needs time to slow down. So each
direction has an *envelope*. It rises with the command at once, and falls at the guaranteed
deceleration. A sample is bad when it exceeds the envelope by the tolerance, or when it moves
against a command whose opposite envelope is zero. Bad time adds up. Good time subtracts at half the
rate, so alternating samples trip too.

**Standstill** is commanded by STOP, by BRAKE and by a RUN that the motion frame rounds to zero:

======== ============================================================= ===========================
phase    entered                                                       supervised
======== ============================================================= ===========================
MOVING   motion is commanded                                           runaway
STOPPING standstill is commanded, or safety has just started           it stands within
                                                                       v / a + 0.5 s, at most 3 s
STANDING 0.2 s of measured standstill                                  it stays within 0.05 m and
                                                                       0.05 rad of that place
======== ============================================================= ===========================

``common/standstill.py`` measures the displacement from that place. An unknown velocity is not
standstill and counts as the highest; the first known one then shortens the time limit. A motion of
less than 0.5 s adds its duration to the time limit and does not renew the limit, unless the vehicle
stood meanwhile. Otherwise repeated short motions would postpone the limit without end.

A vehicle that rolled on or away, for example down a slope, is held by BRAKE until a source commands
motion, also after a reset: STOP would release its wheels, and it would leave its place again before
the operator can drive off.
"""

from enum import Enum

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import STILL, Twist
from common.standstill import Displacement, stopping_ns
from services.safety.config import SafetyConfig
from t2.messages import Mileage

GOOD_PER_BAD = 0.5  # a good second subtracts half a bad second
FASTER_MPS = 0.3  # than commanded
FASTER_RADPS = 0.5
AGAINST_MPS = 0.1  # against the command; above noise and lag
AGAINST_RADPS = 0.2
LONGEST_STOP_NS = 3 * NS_PER_S  # limit of v / a + grace for any settings
BRIEF_NS = NS_PER_S // 2  # a shorter motion does not renew the time limit
CONFIRM_NS = NS_PER_S // 5  # of standstill until the place is recorded


class Bounds(Struct, frozen=True):
    """Limits of one axis, in m and s or rad and s."""

    deceleration: float  # guaranteed
    tolerance: float  # over the envelope
    against: float  # speed against the command, above noise
    patience_s: float  # bad time that trips


class Runaway(Struct, frozen=True):
    """Runaway on one axis: envelopes as magnitudes, and the accumulated bad time."""

    ahead: float = 0.0
    back: float = 0.0
    bad_s: float = 0.0

    def follow(self, commanded: float, measured: float, dt_s: float, bounds: Bounds) -> "Runaway":
        """Return the axis ``dt_s`` seconds later."""
        fall = bounds.deceleration * dt_s
        ahead = max(commanded, self.ahead - fall, 0.0)
        back = max(-commanded, self.back - fall, 0.0)
        bad = (
            measured > ahead + bounds.tolerance
            or -measured > back + bounds.tolerance
            or (commanded < 0 and ahead == 0 and measured > bounds.against)
            or (commanded > 0 and back == 0 and -measured > bounds.against)
        )
        bad_s = self.bad_s + (dt_s if bad else -dt_s * GOOD_PER_BAD)
        # Capped at the limit, so that the cause clears as soon as the vehicle obeys again.
        return Runaway(ahead, back, min(max(0.0, bad_s), bounds.patience_s))


class Phase(Enum):
    """Phase of a standstill."""

    MOVING = "moving"
    STOPPING = "stopping"
    STANDING = "standing"


class Standstill(Struct, frozen=True):
    """Phase, and the displacement from the place of the standstill."""

    phase: Phase = Phase.STOPPING
    due_ns: int | None = None  # time limit of the standstill; None until a velocity was measured
    began_ns: int = 0  # start of the newest commanded motion
    still_ns: int | None = None  # start of the measured standstill
    displacement: Displacement = Displacement()
    has_left: bool = False  # whether the vehicle has just left the place of its standstill
    rolls: bool = False  # STOP did not hold it since the last motion: BRAKE does

    def is_late(self, now_ns: int) -> bool:
        """Return whether the time limit has passed without a known standstill."""
        overdue = self.due_ns is not None and now_ns > self.due_ns
        return self.phase is Phase.STOPPING and overdue and not self.displacement.is_standing

    def moving(self, now_ns: int) -> "Standstill":
        """Return the state of a motion; the time limit is kept until the vehicle stands."""
        began_ns = self.began_ns if self.phase is Phase.MOVING else now_ns
        due_ns = None if self.displacement.is_standing else self.due_ns
        return replace(self.begin(Phase.MOVING, due_ns), began_ns=began_ns, rolls=False)

    def settled(self, now_ns: int) -> "Standstill":
        """Return the state of a stop; the place is recorded once the standstill is confirmed."""
        if not self.displacement.is_standing:
            return replace(self, still_ns=None)
        still_ns = now_ns if self.still_ns is None else self.still_ns
        if now_ns - still_ns >= CONFIRM_NS:
            return self.begin(Phase.STANDING, None)
        return replace(self, still_ns=still_ns)

    def begin(self, phase: Phase, due_ns: int | None) -> "Standstill":
        """Return a phase at its beginning, at the present place."""
        here = self.displacement.from_here()
        return replace(self, phase=phase, due_ns=due_ns, still_ns=None, displacement=here)


class MotionWatch(Struct, frozen=True):
    """The measured motion beside the commanded one."""

    linear: Runaway = Runaway()
    angular: Runaway = Runaway()
    standstill: Standstill = Standstill()
    runs_away: bool = False  # whether it did not move as commanded for too long


class Supervisor:
    """Supervises one vehicle; holds no state."""

    def __init__(self, settings: SafetyConfig) -> None:
        body, patience_s = settings.vehicle, settings.times.runaway_time
        self._linear = Bounds(body.deceleration, FASTER_MPS, AGAINST_MPS, patience_s)
        self._angular = Bounds(body.angular_deceleration, FASTER_RADPS, AGAINST_RADPS, patience_s)
        # Assumed while the velocity is unknown.
        self._fastest = Twist(body.max_linear, body.max_angular)

    def follow(
        self,
        before: MotionWatch,
        sent: Twist,
        velocity: Latest[Twist] | None,
        mileage: Latest[Mileage] | None,
        *,
        step_s: float,
        now_ns: int,
    ) -> MotionWatch:
        """Return the state ``step_s`` after the twist was sent; None is an unknown measurement."""
        measured = velocity.value if velocity else STILL
        linear = before.linear.follow(sent.linear, measured.linear, step_s, self._linear)
        angular = before.angular.follow(sent.angular, measured.angular, step_s, self._angular)
        return MotionWatch(
            linear,
            angular,
            self._standstill(before.standstill, sent.rounds_to_zero, velocity, mileage, now_ns),
            runs_away=max(linear.bad_s, angular.bad_s) >= self._linear.patience_s,
        )

    def _standstill(
        self,
        before: Standstill,
        commanded: bool,
        velocity: Latest[Twist] | None,
        mileage: Latest[Mileage] | None,
        now_ns: int,
    ) -> Standstill:
        displacement = before.displacement.with_velocity(velocity).with_mileage(mileage)
        after = replace(before, displacement=displacement, has_left=False)
        if not commanded:
            return after.moving(now_ns)
        if before.phase is Phase.MOVING:
            lasted_ns = now_ns - before.began_ns
            if before.due_ns is not None and lasted_ns < BRIEF_NS:
                return after.begin(Phase.STOPPING, before.due_ns + lasted_ns)
            return after.begin(Phase.STOPPING, self._due_ns(velocity, now_ns))
        if before.phase is Phase.STANDING:
            if not displacement.has_left:
                return after
            gone = replace(after, has_left=True, rolls=True)
            return gone.begin(Phase.STOPPING, self._due_ns(velocity, now_ns))
        if velocity is not None and before.displacement.velocity is None:  # it was unknown
            due_ns = self._due_ns(velocity, now_ns)
            after = replace(after, due_ns=min(due_ns, after.due_ns or due_ns))
        if velocity is not None and after.is_late(now_ns):
            after = replace(after, rolls=True)
        return after.settled(now_ns)

    def _due_ns(self, known: Latest[Twist] | None, now_ns: int) -> int:
        velocity = known.value if known else self._fastest
        stop_ns = stopping_ns(velocity, self._linear.deceleration, self._angular.deceleration)
        return now_ns + min(stop_ns, LONGEST_STOP_NS)
