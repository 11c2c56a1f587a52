"""Verdict on a motion: direction and speed of the wheels, by the board's counters. Pure.

Three quantities are compared: the command, the velocity that the board measures, and the distance
and heading that it counts. The counters are the reference: their unit is known. Ratios are taken
while safety grants the full speed and after the vehicle had time to reach it:

================= ==================== =====================================================
counted/commanded measured/counted     meaning
================= ==================== =====================================================
about 1           about 1              correct
negative          about 1              the motion is inverted
about 1           negative             the measured velocity is inverted
0                 -                    the wheels do not turn, or the counter does not count
ratio of units    -                    the firmware's unit differs from the setting
                                       ``wire.command_angular_unit``
-                 inverse of the ratio the firmware's unit differs from the setting
                                       ``wire.feedback_angular_unit``
================= ==================== =====================================================
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import mean

from cli.commission.report import Row, Verdict, judged, seconds
from cli.commission.texts import ENGLISH, Say
from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from t2.messages import Command, Field, Mileage, Motion, SafetyState, Velocity
from t2.words import render

SETTLE_NS = round(0.4 * NS_PER_S)  # to reach the speed; a margin for unknown vehicles
WINDOW_NS = round(0.6 * NS_PER_S)  # to measure: 0.06 m of 1 mm steps, 0.12 rad of 0.0017 rad steps
FULL = 0.95  # of the requested speed counts as granted
NOTHING = 0.15  # of the commanded speed
RATIO = 0.25  # allowed deviation from 1; that of the other unit is 0.43 or more
UNIT_MATCH = 0.15  # allowed deviation from the other unit's ratio
STOP_S = 2.0  # limit for standstill after the last request
UNITS = {"decidegree": math.radians(0.1), "milliradian": 0.001}  # rad/s per unit of the wire
TOO_FAST = 3.0  # multiple of the requested speed that ends the motion at once


@dataclass(frozen=True, slots=True)
class Run:
    """One requested motion, with all messages from its start to standstill."""

    requested: Twist  # one of the two is zero
    unit: str  # ``wire.command_angular_unit`` of the bridge
    feedback: str  # ``wire.feedback_angular_unit`` of the bridge
    ended_ns: int  # when zero was first requested
    motions: Sequence[Latest[Motion]]
    velocities: Sequence[Latest[Velocity]]
    mileages: Sequence[Latest[Mileage]]
    states: Sequence[Latest[SafetyState]]
    say: Say = ENGLISH

    @property
    def turns(self) -> bool:
        """Whether it is a turn."""
        return self.requested.angular != 0

    @property
    def unit_of_rate(self) -> str:
        """Unit of a velocity on the requested axis."""
        return "rad/s" if self.turns else "m/s"

    def part(self, linear: float, angular: float) -> float:
        """Return the value on the requested axis."""
        return angular if self.turns else linear


@dataclass(frozen=True, slots=True)
class Measured:
    """Mean values over the window; m/s, or rad/s for a turn."""

    commanded: float
    velocity: float
    counted: float
    seconds: float


def too_fast(requested: Twist, velocity: Velocity) -> bool:
    """Return whether the vehicle is so much faster than requested that it must stop."""
    linear = max(abs(requested.linear), 0.1)
    angular = max(abs(requested.angular), 0.2)
    return abs(velocity.linear) > TOO_FAST * linear or abs(velocity.angular) > TOO_FAST * angular


def judge_motion(run: Run) -> Verdict:
    """Return the verdict on one motion."""
    measured, stood_s, say = measure(run), stood_after_s(run), run.say
    if measured is None:
        return judged(
            [_not_granted(run)], "", [("standstill after", seconds(stood_s, say=run.say))]
        )
    problems = list(_problems(run, measured))
    if stood_s is None or stood_s > STOP_S:
        problems.append(say("motion.not_stood", limit=STOP_S))
    counted, commanded = f"{measured.counted:.3f}", f"{measured.commanded:.3f}"
    text = say("motion.good", counted=counted, unit=run.unit_of_rate, commanded=commanded)
    return judged(problems, text, _data(run, measured, stood_s), say)


def measure(run: Run) -> Measured | None:
    """Return the means while the full speed was granted; None if that was too short."""
    requested = run.part(run.requested.linear, run.requested.angular)
    full = [
        m.received_ns
        for m in run.motions
        if m.value.command is Command.RUN
        and run.part(m.value.linear, m.value.angular) / requested >= FULL
    ]
    if not full:
        return None
    begin_ns, end_ns = full[0] + SETTLE_NS, full[-1]
    velocities = [v.value for v in run.velocities if begin_ns <= v.received_ns <= end_ns]
    counts = [c.value for c in run.mileages if begin_ns <= c.received_ns <= end_ns]
    motions = [m.value for m in run.motions if begin_ns <= m.received_ns <= end_ns]
    whole = len(motions) == sum(begin_ns <= at_ns <= end_ns for at_ns in full)
    if not whole or end_ns - begin_ns < WINDOW_NS or not velocities or len(counts) < 2:
        return None
    # By the bridge's clock, which is independent of network delays.
    span_s = (counts[-1].mono_ns - counts[0].mono_ns) / NS_PER_S
    way = counts[-1].distance - counts[0].distance
    turn = sum(math.remainder(b.heading - a.heading, math.tau) for a, b in pairwise(counts))
    return Measured(
        commanded=mean(run.part(m.linear, m.angular) for m in motions),
        velocity=mean(run.part(v.linear, v.angular) for v in velocities),
        counted=run.part(way, turn) / span_s,
        seconds=span_s,
    )


def stood_after_s(run: Run) -> float | None:
    """Return the time from the release to lasting standstill; None without standstill."""
    stood_ns: int | None = None
    for velocity in run.velocities:
        if velocity.received_ns < run.ended_ns:
            continue
        if not Twist(velocity.value.linear, velocity.value.angular).is_standing:
            stood_ns = None
        elif stood_ns is None:
            stood_ns = velocity.received_ns
    return None if stood_ns is None else (stood_ns - run.ended_ns) / NS_PER_S


def _problems(run: Run, it: Measured) -> Iterator[str]:
    ratio, say = it.counted / it.commanded, run.say
    if abs(ratio) < NOTHING:
        yield _nothing_counted(run, it)
        return
    if ratio < 0:
        yield say("motion.clockwise") if run.turns else say("motion.sign", way="backward")
    if abs(abs(ratio) - 1) > RATIO:
        yield say("motion.ratio", ratio=abs(ratio))
        yield _unit_hint(run, abs(ratio), "command", run.unit)
    measured = it.velocity / it.counted
    if measured < 0:
        yield say("motion.measured_sign")
    elif abs(measured - 1) > RATIO:
        yield say("motion.measured", ratio=measured)
        # A larger unit of the firmware makes our reading smaller.
        yield _unit_hint(run, 1 / measured if measured else 0.0, "feedback", run.feedback)


def _nothing_counted(run: Run, it: Measured) -> str:
    counter = "heading" if run.turns else "distance"
    if abs(it.velocity / it.commanded) < NOTHING:
        return run.say(f"motion.none_{counter}")
    return run.say(f"motion.no_{counter}")


def _unit_hint(run: Run, ratio: float, direction: str, setting: str) -> str:
    """Name the firmware's unit if it explains a ratio of turning rates."""
    (other,) = UNITS.keys() - {setting}
    if not run.turns or abs(ratio * UNITS[setting] / UNITS[other] - 1) > UNIT_MATCH:
        return ""
    return run.say("motion.unit", direction=direction, unit=other)


def _not_granted(run: Run) -> str:
    held = [state.value for state in run.states if state.value.verdict != "run"]
    texts = list(dict.fromkeys(render(it.phrases, run.say.language, it.text) for it in held))
    reason = run.say("motion.reports", text=run.say.sentences(texts[-3:])) if texts else ""
    speeds = [run.part(v.value.linear, v.value.angular) for v in run.velocities]
    peak = max(speeds, key=abs, default=0.0)
    requested = run.part(run.requested.linear, run.requested.angular)
    about: dict[str, Field] = {"peak": peak, "unit": run.unit_of_rate, "requested": requested}
    return run.say.sentences([run.say("motion.too_short", **about), reason])


def _data(run: Run, it: Measured, stood_s: float | None) -> list[Row]:
    unit = run.unit_of_rate
    return [
        ("measured over", f"{it.seconds:.2f} s"),
        (f"commanded, {unit}", f"{it.commanded:.3f}"),
        (f"counted, {unit}", f"{it.counted:.3f}"),
        (f"measured velocity, {unit}", f"{it.velocity:.3f}"),
        ("counted / commanded", f"{it.counted / it.commanded:.3f}"),
        ("standstill after", seconds(stood_s, say=run.say)),
    ]
