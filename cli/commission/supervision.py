"""Supervision of a manoeuvre while the vehicle moves: when it ends, and what contradicts it. Pure.

The travel is known twice: by the board's counters, and by the integral of its velocities. The
larger one counts against the limits. A contradiction ends the motion by an emergency stop:

================= ====================================================== =================
problem           found when                                             what follows
================= ====================================================== =================
wrong sign        either travel is ``AGAINST`` against the request       the drive ends
too fast          two velocities beyond 1.3 times the request            the drive ends
unlike            counters and velocities differ by over 25 %            the drive ends
drift             a straight line turns, or a turn on the spot drives    it is repeated
================= ====================================================== =================
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from statistics import mean
from typing import Literal

from msgspec import Struct

from cli.commission.manoeuvres import Ending, Manoeuvre, speed
from cli.commission.texts import ENGLISH, Say
from common.freshness import NS_PER_S, Latest
from common.motion import STANDING_MPS, STANDING_RADPS, STILL, Twist
from t2.messages import Command, Mileage, Motion, Velocity

# "again": the operator may repeat it; "slower": nothing faster follows; "end": the drive ends.
Then = Literal["again", "slower", "end"]

FULL = 0.95  # of the requested speed counts as granted
TOO_FAST = 1.3  # multiple of the requested speed, plus the standstill threshold
UNLIKE = 0.25  # of the larger travel
UNLIKE_M, UNLIKE_RAD = 0.03, 0.05  # resolution and noise
COMPARED_M, COMPARED_RAD = 0.1, 0.15  # travel from which counters and velocities are compared
LATE_S = 0.12  # the counters may be so much older than the velocities
AGAINST_M, AGAINST_RAD = 0.03, 0.06
DRIFT_RAD, DRIFT_M = 0.15, 0.15
STEADY = 0.03  # of the speed: difference between two halves of ``steady_s``
STEADY_MPS, STEADY_RADPS = 0.01, 0.03


class Problem(Struct, frozen=True):
    """What contradicts the expectation, by how much, and what follows."""

    text: str
    then: Then
    ending: Ending = "brake"  # of the motion


@dataclass(slots=True)
class Travel:
    """Travel since the start, in m and rad, by counters and by velocities."""

    counted: Twist = STILL
    integrated: Twist = STILL
    velocity: Velocity | None = None  # the newest
    before: Velocity | None = None  # the one before it
    mileage: Mileage | None = None  # the newest

    def add_velocity(self, now: Velocity) -> None:
        """Add the next velocity."""
        self.before, self.velocity = self.velocity, now
        if self.before is not None:
            dt_s = (now.mono_ns - self.before.mono_ns) / NS_PER_S
            self.integrated = Twist(
                self.integrated.linear + dt_s * (now.linear + self.before.linear) / 2,
                self.integrated.angular + dt_s * (now.angular + self.before.angular) / 2,
            )

    def add_mileage(self, now: Mileage) -> None:
        """Add the next reading of the counters."""
        before, self.mileage = self.mileage, now
        if before is not None and before.epoch == now.epoch:
            self.counted = Twist(
                self.counted.linear + now.distance - before.distance,
                self.counted.angular + math.remainder(now.heading - before.heading, math.tau),
            )


@dataclass(slots=True)
class Supervision:
    """One motion under way."""

    manoeuvre: Manoeuvre
    travel: Travel = field(default_factory=Travel)
    say: Say = ENGLISH
    full_ns: int | None = None  # since when the full speed is granted, by the sender's clock
    _taken: list[int] = field(default_factory=lambda: [0, 0, 0])

    def take(
        self,
        motions: Sequence[Latest[Motion]],
        velocities: Sequence[Latest[Velocity]],
        mileages: Sequence[Latest[Mileage]],
    ) -> bool:
        """Take the messages that are new in these logs; return whether there are any."""
        before = sum(self._taken)
        for motion in motions[self._taken[0] :]:
            self._granted(motion.value)
        for velocity in velocities[self._taken[1] :]:
            self.travel.add_velocity(velocity.value)
        for mileage in mileages[self._taken[2] :]:
            self.travel.add_mileage(mileage.value)
        self._taken = [len(motions), len(velocities), len(mileages)]
        return sum(self._taken) > before

    def _granted(self, motion: Motion) -> None:
        asked = self.manoeuvre.twist
        is_full = motion.command is Command.RUN and all(
            abs(granted) >= FULL * abs(wanted)
            for granted, wanted in ((motion.linear, asked.linear), (motion.angular, asked.angular))
        )
        if not is_full:
            self.full_ns = None
        elif self.full_ns is None:
            self.full_ns = motion.mono_ns

    @property
    def is_at_limit(self) -> bool:
        """Whether the travel has reached a limit."""
        limit, travel = self.manoeuvre.limit, self.travel
        return any(
            0 < bound <= max(abs(counted), abs(integrated))
            for bound, counted, integrated in (
                (limit.linear, travel.counted.linear, travel.integrated.linear),
                (limit.angular, travel.counted.angular, travel.integrated.angular),
            )
        )

    def is_steady(self, velocities: Sequence[Latest[Velocity]]) -> bool:
        """Return whether the speed was steady for long enough."""
        if self.full_ns is None or not velocities or math.isinf(self.manoeuvre.steady_s):
            return False
        newest = velocities[-1].value
        begin_ns = newest.mono_ns - round(self.manoeuvre.steady_s * NS_PER_S)
        if self.full_ns > begin_ns:
            return False
        middle_ns = (begin_ns + newest.mono_ns) // 2
        recent = list(_since(velocities, begin_ns))
        halves = ([v for v in recent if v.mono_ns < middle_ns],
                  [v for v in recent if v.mono_ns >= middle_ns])  # fmt: skip
        if not all(halves):
            return False
        return _is_close(halves, lambda v: v.linear, STEADY_MPS) and _is_close(
            halves, lambda v: v.angular, STEADY_RADPS
        )

    def problem(self) -> Problem | None:
        """Return the first contradiction, if there is any."""
        checks = (self._against, self._too_fast, self._unlike, self._drift)
        return next((found for check in checks if (found := check())), None)

    def _against(self) -> Problem | None:
        wanted, travel = self.manoeuvre.twist, self.travel
        for source, way in (("counters", travel.counted), ("velocities", travel.integrated)):
            if way.linear * _sign(wanted.linear) < -AGAINST_M:
                text = self._sign_text("linear", source, way.linear, wanted.linear)
                return Problem(text, "end")
            if way.angular * _sign(wanted.angular) < -AGAINST_RAD:
                text = self._sign_text("angular", source, way.angular, wanted.angular)
                return Problem(text, "end")
        return None

    def _sign_text(self, axis: str, source: str, way: float, wanted: float) -> str:
        by = self.say(f"by.{source}")
        return self.say(f"end.sign_{axis}", by=by, way=way, wanted=wanted)

    def _too_fast(self) -> Problem | None:
        """Return the excess of the smaller one of two velocities: one may be noise."""
        wanted, now, before = self.manoeuvre.twist, self.travel.velocity, self.travel.before
        if now is None or before is None:
            return None
        measured = Twist(
            min(abs(now.linear), abs(before.linear)), min(abs(now.angular), abs(before.angular))
        )
        is_linear = measured.linear > TOO_FAST * abs(wanted.linear) + STANDING_MPS
        is_angular = measured.angular > TOO_FAST * abs(wanted.angular) + STANDING_RADPS
        if not (is_linear and wanted.linear) and not (is_angular and wanted.angular):
            return None
        linear = measured.linear if is_linear and wanted.linear else 0.0
        shown = Twist(linear, 0.0 if linear else measured.angular)
        name = "end.fast_linear" if linear else "end.fast_angular"
        return Problem(self.say(name, measured=speed(shown), wanted=speed(wanted)), "end")

    def _unlike(self) -> Problem | None:
        """Compare both travels while the vehicle moves, when the counters may be late."""
        now = self.travel.velocity
        lag = Twist(LATE_S * abs(now.linear), LATE_S * abs(now.angular)) if now else STILL
        return unlike(self.travel, lag, self.say)

    def _drift(self) -> Problem | None:
        it, way = self.manoeuvre, self.travel.counted
        if it.is_straight and abs(way.angular) > DRIFT_RAD:
            side = "left" if way.angular > 0 else "right"
            degrees, distance = abs(math.degrees(way.angular)), abs(way.linear)
            text = self.say("end.drift_straight", degrees=degrees, side=side, distance=distance)
            return Problem(text, "again")
        if it.is_turn and abs(way.linear) > DRIFT_M:
            where = "forward" if way.linear > 0 else "backward"
            text = self.say("end.drift_turn", distance=abs(way.linear), way=where)
            return Problem(text, "again")
        return None


def unlike(travel: Travel, late: Twist = STILL, say: Say = ENGLISH) -> Problem | None:
    """Return the difference of counters and velocities if it is over 25 %.

    ``late``: m and rad by which the counters may be behind.
    """
    rows = (
        ("m", travel.counted.linear, travel.integrated.linear, COMPARED_M, UNLIKE_M + late.linear),
        ("rad", travel.counted.angular, travel.integrated.angular, COMPARED_RAD,
         UNLIKE_RAD + late.angular),
    )  # fmt: skip
    for unit, counted, integrated, from_, noise in rows:
        larger = max(abs(counted), abs(integrated))
        if larger >= from_ and abs(counted - integrated) > UNLIKE * larger + noise:
            share = abs(counted - integrated) / larger
            text = say(f"end.unlike_{unit}", share=share, counted=counted, integrated=integrated)
            return Problem(text, "end")
    return None


def _is_close(
    halves: Sequence[Sequence[Velocity]], of: Callable[[Velocity], float], noise: float
) -> bool:
    first, second = (mean(map(of, half)) for half in halves)
    return abs(first - second) <= STEADY * abs(second) + noise


def _since(velocities: Sequence[Latest[Velocity]], begin_ns: int) -> Iterator[Velocity]:
    """Yield the velocities from a time on, the newest first."""
    for each in reversed(velocities):
        if each.value.mono_ns < begin_ns:
            return
        yield each.value


def _sign(value: float) -> float:
    """Return -1, 0 or 1."""
    return math.copysign(1.0, value) if value else 0.0
