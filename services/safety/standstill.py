"""Standstill supervision: the vehicle stops on command and stays at that place.

Standstill is commanded by STOP, by BRAKE and by a RUN that the motion frame rounds to zero. Three
phases:

======== ============================================================= ===========================
phase    entered                                                       supervised
======== ============================================================= ===========================
MOVING   motion is commanded                                           ``runaway.py``
STOPPING standstill is commanded, or safety has just started           it stands within
                                                                       v / a + 0.5 s, at most 3 s
STANDING 0.2 s of measured standstill                                  it stays within 0.05 m and
                                                                       0.05 rad of that place
======== ============================================================= ===========================

A vehicle in a curve slows down on both axes together, so the longer of the two times counts. An
unknown velocity is not standstill and counts as the highest; the first known one then shortens the
time limit. A motion of less than 0.5 s adds its duration to the time limit
and does not renew the limit, unless the vehicle stood meanwhile. Otherwise repeated short motions
would postpone the limit without end.

A vehicle that rolled on or away, for example down a slope, is held by BRAKE until a source commands
motion, also after a reset: STOP would release its wheels, and it would leave its place again before
the operator can drive off.

The distance from that place is measured twice. The board's counters show a slow creep. The
velocities show a fast motion, even while the counters are not answered. Neither may trip by noise,
drift or a restart of the board:

- of two consecutive velocities the smaller counts, and none below the standstill threshold
- the integral of the velocities leaks
- an implausibly large counter step is a damaged frame and does not count
- the heading counter may drift like a gyroscope
"""

import math
from enum import Enum

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import Mileage
from common.motion import (
    AWAY_M,
    AWAY_RAD,
    DRIFT_RADPS,
    LEAK_S,
    STANDING_MPS,
    STANDING_RADPS,
    STILL,
    Twist,
)
from services.safety.config import Safety

GRACE_NS = NS_PER_S // 2  # on top of v / a
LONGEST_STOP_NS = 3 * NS_PER_S  # limit of v / a + grace for any settings
BRIEF_NS = NS_PER_S // 2  # a shorter motion does not renew the time limit
CONFIRM_NS = NS_PER_S // 5  # of standstill until the place is recorded
LONGEST_GAP_S = 0.1  # between two velocities; over longer gaps the motion is unknown
FASTEST_MPS = 1.5  # plausible for a counter step, which may always be ``AWAY_M``
FASTEST_RADPS = 2.0


class Phase(Enum):
    """Phase of the supervision."""

    MOVING = "moving"
    STOPPING = "stopping"
    STANDING = "standing"


class Measured(Struct, frozen=True):
    """Newest velocity and counters of the board; None while unknown."""

    velocity: Latest[Twist] | None
    counters: Latest[Mileage] | None


class Velocities(Struct, frozen=True):
    """The newest measured velocity, and the common part of the last two."""

    newest: Twist | None = None  # None while unknown
    received_ns: int = 0
    steady: Twist | None = None

    @property
    def standing(self) -> bool:
        """Whether the vehicle is known to be at standstill."""
        return self.steady is not None and self.steady.is_standing


class Standstill(Struct, frozen=True):
    """Phase, and the distance from the place of the standstill."""

    phase: Phase = Phase.STOPPING
    due_ns: int | None = None  # time limit of the standstill; None until a velocity was measured
    began_ns: int = 0  # start of the newest commanded motion
    still_ns: int | None = None  # start of the measured standstill
    velocities: Velocities = Velocities()
    counters: Latest[Mileage] | None = None
    integrated: Twist = STILL  # m and rad, from the velocities
    counted: Twist = STILL  # m and rad, from the counters
    left: bool = False  # whether the vehicle has just left the place of its standstill
    rolls: bool = False  # STOP did not hold it since the last motion: BRAKE does

    def is_late(self, now_ns: int) -> bool:
        """Return whether the time limit has passed without a known standstill."""
        overdue = self.due_ns is not None and now_ns > self.due_ns
        return self.phase is Phase.STOPPING and overdue and not self.velocities.standing

    @property
    def text(self) -> str:
        """Text for the operator about a vehicle that does not stop."""
        twist = self.velocities.steady
        if twist is None:
            return "Standstill is not confirmed: no velocity is received."
        return f"The vehicle does not stop: {twist.linear:.2f} m/s, {twist.angular:.2f} rad/s."


class Supervisor(Struct, frozen=True):
    """Supervises one vehicle; holds no state."""

    deceleration: float  # m/s^2, guaranteed
    angular_deceleration: float  # rad/s^2
    fastest: Twist  # assumed while the velocity is unknown

    def follow(
        self, before: Standstill, commanded: bool, seen: Measured, now_ns: int
    ) -> Standstill:
        """Return the state now; ``commanded``: whether standstill is commanded."""
        known = seen.velocity
        if not commanded and _knows(before, seen):
            return before
        after = replace(_count(_integrate(before, known), seen.counters), left=False)
        if not commanded:
            return _move(after, now_ns)
        if before.phase is Phase.MOVING:
            return self._stop(after, known, now_ns)
        if before.phase is Phase.STANDING:
            return self._stay(after, known, now_ns)
        if known is not None and before.velocities.newest is None:  # it was unknown until now
            due_ns = self._due_ns(known, now_ns)
            after = replace(after, due_ns=min(due_ns, after.due_ns or due_ns))
        if known is not None and after.is_late(now_ns):
            after = replace(after, rolls=True)
        return _settle(after, now_ns)

    def _stop(self, standstill: Standstill, known: Latest[Twist] | None, now_ns: int) -> Standstill:
        lasted_ns = now_ns - standstill.began_ns
        if standstill.due_ns is not None and lasted_ns < BRIEF_NS:
            return _begin(standstill, Phase.STOPPING, standstill.due_ns + lasted_ns)
        return _begin(standstill, Phase.STOPPING, self._due_ns(known, now_ns))

    def _stay(self, standstill: Standstill, known: Latest[Twist] | None, now_ns: int) -> Standstill:
        ways = (standstill.integrated, standstill.counted)
        if all(abs(way.linear) <= AWAY_M and abs(way.angular) <= AWAY_RAD for way in ways):
            return standstill
        left = replace(standstill, left=True, rolls=True)
        return _begin(left, Phase.STOPPING, self._due_ns(known, now_ns))

    def _due_ns(self, known: Latest[Twist] | None, now_ns: int) -> int:
        speed = known.value if known else self.fastest
        linear_s = abs(speed.linear) / self.deceleration
        angular_s = abs(speed.angular) / self.angular_deceleration
        stop_ns = round(max(linear_s, angular_s) * NS_PER_S) + GRACE_NS
        return now_ns + min(stop_ns, LONGEST_STOP_NS)


def supervisor(settings: Safety) -> Supervisor:
    """Return the supervisor for these settings."""
    return Supervisor(
        settings.deceleration,
        settings.angular_deceleration,
        Twist(settings.max_linear, settings.max_angular),
    )


def _knows(before: Standstill, seen: Measured) -> bool:
    """Return whether a motion goes on and nothing new was measured."""
    velocity_ns = seen.velocity.received_ns if seen.velocity else None
    same = before.counters is seen.counters and before.velocities.received_ns == velocity_ns
    return before.phase is Phase.MOVING and same


def _begin(standstill: Standstill, phase: Phase, due_ns: int | None) -> Standstill:
    """Return a phase at its beginning, with zero travel."""
    return replace(
        standstill, phase=phase, due_ns=due_ns, still_ns=None, integrated=STILL, counted=STILL
    )


def _move(standstill: Standstill, now_ns: int) -> Standstill:
    """Return the state of a motion; the time limit is kept until the vehicle stands."""
    began_ns = standstill.began_ns if standstill.phase is Phase.MOVING else now_ns
    due_ns = None if standstill.velocities.standing else standstill.due_ns
    # 1 equivalent mutant: None is as false as False.
    return replace(_begin(standstill, Phase.MOVING, due_ns), began_ns=began_ns, rolls=False)


def _settle(standstill: Standstill, now_ns: int) -> Standstill:
    """Record the place once the standstill is confirmed."""
    if not standstill.velocities.standing:
        return replace(standstill, still_ns=None)
    still_ns = now_ns if standstill.still_ns is None else standstill.still_ns
    if now_ns - still_ns >= CONFIRM_NS:
        return _begin(standstill, Phase.STANDING, None)
    return replace(standstill, still_ns=still_ns)


def _integrate(standstill: Standstill, known: Latest[Twist] | None) -> Standstill:
    """Integrate the newest velocity, once."""
    before = standstill.velocities
    if known is None:
        return replace(standstill, velocities=Velocities())
    if known.received_ns == before.received_ns:
        return standstill
    newest = known.value
    if before.newest is None:
        return replace(standstill, velocities=Velocities(newest, known.received_ns, newest))
    steady = _steady(before.newest, newest)
    gap_s = min((known.received_ns - before.received_ns) / NS_PER_S, LONGEST_GAP_S)
    kept = 1 - gap_s / LEAK_S
    way = standstill.integrated
    return replace(
        standstill,
        velocities=Velocities(newest, known.received_ns, steady),
        integrated=Twist(
            way.linear * kept + _over(steady.linear, STANDING_MPS) * gap_s,
            way.angular * kept + _over(steady.angular, STANDING_RADPS) * gap_s,
        ),
    )


def _steady(before: Twist, after: Twist) -> Twist:
    """Return the common part of two velocities, so that a single wrong one does not count."""
    return Twist(_common(before.linear, after.linear), _common(before.angular, after.angular))


def _common(one: float, other: float) -> float:
    # 1 equivalent mutant: the smaller of the two is zero then.
    return 0.0 if one * other <= 0 else min(one, other, key=abs)


def _over(value: float, threshold: float) -> float:
    return value if abs(value) >= threshold else 0.0


def _count(standstill: Standstill, newest: Latest[Mileage] | None) -> Standstill:
    """Add the newest counters, once."""
    before = standstill.counters
    if newest is None or (before is not None and newest.received_ns == before.received_ns):
        return standstill
    standstill = replace(standstill, counters=newest)
    if before is None or _identity(before.value) != _identity(newest.value):
        return standstill
    gap_s = _gap_s(before, newest)
    step = newest.value.distance - before.value.distance
    turn = math.remainder(newest.value.heading - before.value.heading, math.tau)
    drift = DRIFT_RADPS * gap_s
    # 1 equivalent mutant: only the size of the sum is judged.
    turned = standstill.counted.angular + _credible(turn, max(AWAY_RAD, FASTEST_RADPS * gap_s))
    counted = Twist(
        standstill.counted.linear + _credible(step, max(AWAY_M, FASTEST_MPS * gap_s)),
        math.copysign(max(0.0, abs(turned) - drift), turned),
    )
    return replace(standstill, counted=counted)


def _gap_s(before: Latest[Mileage], newest: Latest[Mileage]) -> float:
    """Return the time between two readings; by send time, as a stall delivers both at once."""
    sent_ns = newest.value.mono_ns - before.value.mono_ns
    return max(newest.received_ns - before.received_ns, sent_ns) / NS_PER_S


def _identity(counters: Mileage) -> tuple[int, int]:
    """Return the bridge's boot and the board's epoch, within which counters are comparable."""
    return counters.boot, counters.epoch


def _credible(step: float, bound: float) -> float:
    """Return a step of a counter; 0 for an implausible one (too large, NaN)."""
    return step if abs(step) <= bound else 0.0
