"""Whether the wheels turn the right way and as fast as they are told, by the board's counters.

What is commanded, what the board measures as velocity and what it counts as distance and heading
are three things. The counters are the truth: their unit is not in question. While safety lets the
full speed through, and the vehicle had time to reach it, each pair gives a ratio:

================= ==================== =====================================================
counted/commanded measured/counted     means
================= ==================== =====================================================
about 1           about 1              all is well
negative          about 1              the motion is the wrong way round
about 1           negative             the measured velocity is the wrong way round
0                 -                    nothing turns, or the counter does not count this
of another unit   -                    the firmware takes another unit than the setting
                                       ``wire.command_angular_unit``
-                 another, inverted    it measures in another one than
                                       ``wire.feedback_angular_unit``
================= ==================== =====================================================
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import mean

from cli.commission.verdict import Row, Verdict, judged
from common.freshness import NS_PER_S, Latest
from common.messages import Mileage, Motion, SafetyState, Velocity
from common.motion import Command, Twist, is_standing

SETTLE_NS = round(0.4 * NS_PER_S)  # to reach the speed; much is known of no vehicle
WINDOW_NS = round(0.6 * NS_PER_S)  # to measure: 0.06 m of 1 mm steps, 0.12 rad of 0.0017 rad steps
FULL = 0.95  # of what was asked counts as let through
NOTHING = 0.15  # of what was commanded
RATIO = 0.25  # off 1 by more is wrong; the next unit is off by 0.43
UNIT_MATCH = 0.15  # of a known unit's ratio
STOP_NS = 2 * NS_PER_S  # to stand, after a speed of this tool
# rad/s for one unit of the wire, by the name of the setting where there is one
UNITS = {
    "decidegree": math.radians(0.1),
    "milliradian": 0.001,
    "0.01 rad/s": 0.01,
    "0.01 deg/s": math.radians(0.01),
    "1 deg/s": math.radians(1),
}
SETTINGS = ("decidegree", "milliradian")
TOO_FAST = 3.0  # times what is asked ends the motion at once


@dataclass(frozen=True, slots=True)
class Run:
    """One motion that was asked for, and all that was heard from its start to standstill."""

    asked: Twist  # one of the two is zero
    unit: str  # ``wire.command_angular_unit`` of the bridge
    feedback: str  # ``wire.feedback_angular_unit`` of the bridge
    released_ns: int  # when zero was asked for
    motions: Sequence[Latest[Motion]]
    velocities: Sequence[Latest[Velocity]]
    mileages: Sequence[Latest[Mileage]]
    states: Sequence[Latest[SafetyState]]

    @property
    def turns(self) -> bool:
        """Whether it is a turn."""
        return self.asked.angular != 0

    def part(self, linear: float, angular: float) -> float:
        """Return the one of the two that was asked for."""
        return angular if self.turns else linear


@dataclass(frozen=True, slots=True)
class Measured:
    """Means over the window; m/s, or rad/s for a turn."""

    commanded: float
    velocity: float
    counted: float
    across: float  # what was counted on the other axis, in its own unit
    seconds: float


def too_fast(asked: Twist, velocity: Velocity) -> bool:
    """Tell whether the vehicle moves so much faster than asked that the wheels must stop."""
    linear = max(abs(asked.linear), 0.1)
    angular = max(abs(asked.angular), 0.2)
    return abs(velocity.linear) > TOO_FAST * linear or abs(velocity.angular) > TOO_FAST * angular


def judge_motion(run: Run) -> Verdict:
    """Judge one motion."""
    measured = measure(run)
    stood_s = stood_after_s(run)
    if measured is None:
        return judged([_not_let_through(run)], "", [("stood still after", _seconds(stood_s))])
    problems = [*_problems(run, measured), *_standing(stood_s)]
    unit = _unit(run)
    fine = f"The board counts {measured.counted:.3f} {unit} of {measured.commanded:.3f} commanded."
    return judged(problems, fine, _data(run, measured, stood_s))


def measure(run: Run) -> Measured | None:
    """Return the means while the full speed was let through; None when that was too short."""
    asked = run.part(run.asked.linear, run.asked.angular)
    full = [
        m.received_ns
        for m in run.motions
        if m.value.command is Command.RUN
        and run.part(m.value.linear, m.value.angular) / asked >= FULL
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
    # The bridge's own clock: what a network does to the times of arrival does not matter.
    seconds = (counts[-1].mono_ns - counts[0].mono_ns) / NS_PER_S
    way = counts[-1].distance - counts[0].distance
    turn = sum(_wrapped(b.heading - a.heading) for a, b in pairwise(counts))
    return Measured(
        commanded=mean(run.part(m.linear, m.angular) for m in motions),
        velocity=mean(run.part(v.linear, v.angular) for v in velocities),
        counted=run.part(way, turn) / seconds,
        across=run.part(turn, way) / seconds,
        seconds=seconds,
    )


def stood_after_s(run: Run) -> float | None:
    """Return how long after the release the vehicle stood and stayed so; None when it did not."""
    stood_ns: int | None = None
    for velocity in run.velocities:
        if velocity.received_ns < run.released_ns:
            continue
        if not is_standing(velocity.value.linear, velocity.value.angular):
            stood_ns = None
        elif stood_ns is None:
            stood_ns = velocity.received_ns
    return None if stood_ns is None else (stood_ns - run.released_ns) / NS_PER_S


def unit_of(ratio: float, setting: str) -> str | None:
    """Return the unit whose size explains a ratio of rates, when ``setting`` is what we reckon."""
    for name, size in UNITS.items():
        expected = size / UNITS[setting]
        if name != setting and abs(ratio / expected - 1) <= UNIT_MATCH:
            return name
    return None


def _problems(run: Run, it: Measured) -> Iterator[str]:
    ratio = it.counted / it.commanded
    turned = abs(ratio) >= NOTHING
    if not turned:
        yield _nothing_counted(run, it)
    elif abs(ratio - 1) > RATIO:
        yield _wrong_ratio(run, ratio)
    if turned and it.velocity / it.counted < 0:
        yield "The measured velocity has the wrong sign: it contradicts the counter."
    elif turned and abs(it.velocity / it.counted - 1) > RATIO:
        yield _wrong_velocity(run, abs(it.velocity / it.counted))


def _nothing_counted(run: Run, it: Measured) -> str:
    counter = "heading" if run.turns else "distance"
    if abs(it.velocity / it.commanded) < NOTHING:
        other = ""
        if abs(it.across) >= NOTHING * (0.1 if run.turns else 0.2):
            other = " It drives instead of turning." if run.turns else " It turns instead."
        return f"No motion: neither the velocity nor the {counter} changes.{other}"
    hint = " One that is taken from a gyroscope counts only on the ground." if run.turns else ""
    return f"The velocity is there, but the {counter} does not count.{hint}"


def _wrong_ratio(run: Run, ratio: float) -> str:
    if ratio < 0:
        way = "clockwise" if run.turns else "backward"
        text = f"The sign is wrong: commanded the positive way, it goes {way}."
        return text if abs(abs(ratio) - 1) <= RATIO else f"{text} {_factor(run, -ratio)}"
    return _factor(run, ratio)


def _factor(run: Run, ratio: float) -> str:
    text = f"It goes {ratio:.2f} times as fast as commanded."
    return _with_unit(run, text, unit_of(ratio, run.unit), "command")


def _wrong_velocity(run: Run, ratio: float) -> str:
    text = f"The measured velocity is {ratio:.2f} times the velocity of the counter."
    # The larger the firmware's unit is, the smaller is what we read.
    return _with_unit(run, text, unit_of(1 / ratio, run.feedback) if ratio else None, "feedback")


def _with_unit(run: Run, text: str, unit: str | None, way: str) -> str:
    if not run.turns:
        return text
    if unit in SETTINGS:
        setting = f"wire.{way}_angular_unit"
        return f'{text} The firmware\'s unit is another: set {setting} = "{unit}".'
    if unit is not None:
        return f"{text} The firmware's unit seems to be {unit}, for which there is no setting."
    return text


def _standing(stood_s: float | None) -> Iterator[str]:
    if stood_s is None or stood_s * NS_PER_S > STOP_NS:
        yield f"It did not stand within {STOP_NS / NS_PER_S:g} s after the release."


def _not_let_through(run: Run) -> str:
    texts = list(dict.fromkeys(s.value.text for s in run.states if s.value.verdict != "run"))
    said = f" Safety said: {' '.join(texts[-3:])}" if texts else ""
    speeds = [run.part(v.value.linear, v.value.angular) for v in run.velocities]
    peak, asked = max(speeds, key=abs, default=0.0), run.part(run.asked.linear, run.asked.angular)
    moved = f" At most {peak:.2f} {_unit(run)} were measured of {asked:.2f} asked."
    return f"The full speed was not let through for long enough to measure.{moved}{said}"


def _data(run: Run, it: Measured, stood_s: float | None) -> list[Row]:
    unit, other = ("rad/s", "m/s") if run.turns else ("m/s", "rad/s")
    return [
        ("measured over", f"{it.seconds:.2f} s"),
        (f"commanded, {unit}", f"{it.commanded:.3f}"),
        (f"counted, {unit}", f"{it.counted:.3f}"),
        (f"measured velocity, {unit}", f"{it.velocity:.3f}"),
        ("counted by commanded", f"{it.counted / it.commanded:.3f}"),
        (f"counted on the other axis, {other}", f"{it.across:.3f}"),
        ("stood still after", _seconds(stood_s)),
    ]


def _unit(run: Run) -> str:
    return "rad/s" if run.turns else "m/s"


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.2f} s"


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)
