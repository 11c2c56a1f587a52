"""Steady motion, ramps and standstill in the streams: scales, delays, biases and noise. Pure.

The counters are the reference: the manual gives their unit. A ratio of turning rates that differs
from 1 shows the firmware's unit (``cli/commission/motion.py``).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isclose
from statistics import mean, stdev

from cli.fit.estimate import Estimate
from cli.fit.streams import Streams, between
from common.freshness import NS_PER_S
from common.motion import STANDING_MPS, STANDING_RADPS, Twist
from common.standstill import comparable
from t2.messages import Command, Motion, Velocity

SETTLE_NS = round(0.5 * NS_PER_S)  # to reach a speed, and to come to rest
STEADY_NS = round(0.5 * NS_PER_S)  # to measure
GAP_NS = round(0.1 * NS_PER_S)  # between two motions of one window
STRAIGHT, ASIDE = Twist(0.05, 0.02), Twist(0.02, 0.1)  # the slowest speed of one axis, the other's
SPAN = Twist(0.15, 0.3)  # commanded change of speed that shows a delay, m/s and rad/s
DELAY_STEP_S, DELAYS = 0.01, 41  # 0 to 0.4 s
LEAST = 8  # velocities of a window
GROUND = ("distance, counted / driven", "turn, counted / turned")
SLOWING = "RUN {axis}: slowing down, measured / commanded"
FALLEN = 0.8  # share of the speed from which a slow-down is measured
RISE = 10  # velocities, 0.2 s, over which an acceleration is measured
SAME, SAME_TWIST = 0.02, Twist(0.01, 0.02)  # deviation of a steady speed: relative, or absolute


Component = Callable[[Velocity | Motion], float]


@dataclass(frozen=True, slots=True)
class Window:
    """A time with one command, or with one kind of it."""

    begin_ns: int
    end_ns: int
    motions: Sequence[Motion]


@dataclass(frozen=True, slots=True)
class Speeds:
    """Commanded, measured and counted velocity of a window."""

    commanded: Twist
    measured: Twist
    counted: Twist


def of_steady_motion(streams: Streams) -> list[Estimate]:
    """Return ratios of commanded, measured and counted speed at steady speeds."""
    straight: list[Speeds] = []
    turning: list[Speeds] = []
    for window in steady(streams.motions):
        if (speeds := _speeds(streams, window)) is None:
            continue
        command = speeds.commanded
        if abs(command.linear) >= STRAIGHT.linear and abs(command.angular) < STRAIGHT.angular:
            straight.append(speeds)
        elif abs(command.angular) >= ASIDE.angular and abs(command.linear) < ASIDE.linear:
            turning.append(speeds)
    counted = [each for each in straight if each.counted.linear]
    turned = [each for each in turning if each.counted.angular]
    rows = (
        ("distance, counted / commanded", "", "",
         [each.counted.linear / each.commanded.linear for each in straight]),
        ("speed, measured / counted", "", "",
         [each.measured.linear / each.counted.linear for each in counted]),
        ("turn counted on a straight line", "rad/m", "",
         [each.counted.angular / each.counted.linear for each in counted]),
        ("turn, counted / commanded", "", "wire.command_angular_unit",
         [each.counted.angular / each.commanded.angular for each in turning]),
        ("turning speed, measured / counted", "", "wire.feedback_angular_unit",
         [each.measured.angular / each.counted.angular for each in turned]),
    )  # fmt: skip
    return [
        Estimate(name=name, unit=unit, values=tuple(values), setting=setting)
        for name, unit, setting, values in rows
        if values
    ]


def of_standstill(streams: Streams) -> list[Estimate]:
    """Return bias and noise of the velocities, and the drift of the heading counter, at rest."""
    found: dict[tuple[str, str], list[float]] = {name: [] for name in (
        ("speed at standstill, bias", "m/s"), ("speed at standstill, noise", "m/s"),
        ("turning speed at standstill, bias", "rad/s"),
        ("turning speed at standstill, noise", "rad/s"),
        ("heading counter at standstill", "rad/s"),
    )}  # fmt: skip
    columns = list(found.values())
    for window in standstills(streams):
        velocities = between(streams.velocities, window.begin_ns, window.end_ns)
        counters = between(streams.mileages, window.begin_ns, window.end_ns)
        for column, of in ((0, _linear), (2, _angular)):
            values = [of(each) for each in velocities]
            columns[column].append(mean(values))
            columns[column + 1].append(stdev(values))
        turn = sum(math.remainder(b.heading - a.heading, math.tau) for a, b in pairwise(counters))
        columns[4].append(turn / ((window.end_ns - window.begin_ns) / NS_PER_S))
    resolution = {"m/s": 0.001, "rad/s": math.radians(0.1)}
    return [
        Estimate(name=name, unit=unit, values=tuple(values), resolution=resolution[unit])
        for (name, unit), values in found.items()
        if values
    ]


def of_ramps(streams: Streams) -> list[Estimate]:
    """Return the delay from a commanded change of speed to the measured one, and the acceleration.

    The vehicle accelerates at most as commanded: safety's ramp is ``safety.linear_acceleration``.
    """
    axes: tuple[tuple[str, str, float, Component], ...] = (
        ("driving", "m/s2", SPAN.linear, _linear), ("turning", "rad/s2", SPAN.angular, _angular)
    )  # fmt: skip
    drives = [one for one in _groups(streams.motions, _runs) if _lasts(one, SETTLE_NS)]
    found = []
    for name, unit, span, of in axes:
        changing = [one for one in drives if _changes(one, span, of)]
        delays = [d for one in changing if (d := _delay_s(streams, one, of)) is not None]
        rises = [r for one in changing if (r := _rise(streams, one, of)) is not None]
        if delays:
            found.append(
                Estimate(
                    name=f"RUN {name}: delay", unit="s", values=tuple(delays),
                    resolution=streams.period_s,
                )
            )  # fmt: skip
        if rises:
            values = tuple(rises)
            found.append(Estimate(name=f"RUN {name}: acceleration", unit=unit, values=values))
        if falls := [f for one in changing if (f := _fall(streams, one, of)) is not None]:
            found.append(Estimate(name=SLOWING.format(axis=name), unit="", values=tuple(falls)))
    return found


def steady(motions: Sequence[Motion]) -> Iterator[Window]:
    """Yield the times of one unchanged command, after the vehicle has reached its speed."""
    for group in _groups(motions, _runs):
        same = [group[0]]
        for one in (*group[1:], None):
            if one and (one.linear, one.angular) == (same[-1].linear, same[-1].angular):
                same.append(one)
                continue
            if _lasts(same, SETTLE_NS + STEADY_NS):
                yield Window(same[0].mono_ns + SETTLE_NS, same[-1].mono_ns, same)
            same = [one] if one else []


def standstills(streams: Streams) -> Iterator[Window]:
    """Yield the times without a commanded speed in which nothing moves."""
    for group in _groups(streams.motions, lambda motion: not _runs(motion)):
        velocities = between(streams.velocities, group[0].mono_ns, group[-1].mono_ns)
        moving = [v for v in velocities if not Twist(v.linear, v.angular).is_standing]
        begin_ns = (moving[-1] if moving else group[0]).mono_ns + SETTLE_NS
        window = Window(begin_ns, group[-1].mono_ns, group)
        counters = between(streams.mileages, begin_ns, window.end_ns)
        still = between(streams.velocities, begin_ns, window.end_ns)
        if window.end_ns - begin_ns < STEADY_NS or len(still) < LEAST or len(counters) < 2:
            continue
        if abs(counters[-1].distance - counters[0].distance) < STANDING_MPS * 2:
            yield window


def of_ground_truth(
    streams: Sequence[Streams], drove: float | None, turned: float | None
) -> Iterator[Estimate]:
    """Yield the counters' ratios to a distance (m) and to turns that were measured on the ground.

    Each of the streams is such a drive. Raise ``ValueError`` if the counters began again in it.
    """
    ways, turns = [], []
    for each in streams:
        counters = each.mileages
        if not all(comparable(*pair) for pair in pairwise(counters)):
            raise ValueError("bridge or board restarted, so the counters show no distance")
        ways.append(abs(counters[-1].distance - counters[0].distance))
        turn = sum(math.remainder(b.heading - a.heading, math.tau) for a, b in pairwise(counters))
        turns.append(abs(turn) / math.tau)
    if drove:
        ratios = tuple(way / drove for way in ways)
        yield Estimate(name=GROUND[0], unit="", values=ratios)
    if turned:
        ratios = tuple(turn / turned for turn in turns)
        yield Estimate(name=GROUND[1], unit="", values=ratios)


def greatest(streams: Streams) -> Twist:
    """Return the greatest speeds that three velocities in a row have reached."""
    triples = list(zip(*(streams.velocities[n:] for n in range(3)), strict=False))
    return Twist(
        max((min(abs(v.linear) for v in each) for each in triples), default=0.0),
        max((min(abs(v.angular) for v in each) for each in triples), default=0.0),
    )


def _linear(of: Velocity | Motion) -> float:
    return of.linear


def _angular(of: Velocity | Motion) -> float:
    return of.angular


def _runs(motion: Motion) -> bool:
    still = abs(motion.linear) < STANDING_MPS and abs(motion.angular) < STANDING_RADPS
    return motion.command is Command.RUN and not still


def _groups(
    motions: Sequence[Motion], belongs: Callable[[Motion], bool]
) -> Iterator[Sequence[Motion]]:
    """Yield the motions in a row that belong together, without a gap."""
    group: list[Motion] = []
    for motion in motions:
        if group and (not belongs(motion) or motion.mono_ns - group[-1].mono_ns > GAP_NS):
            yield group
            group = []
        if belongs(motion):
            group.append(motion)
    if group:
        yield group


def _lasts(group: Sequence[Motion], least_ns: int) -> bool:
    return group[-1].mono_ns - group[0].mono_ns >= least_ns


def _speeds(streams: Streams, window: Window) -> Speeds | None:
    """Return the velocities of a window; None without enough messages, and while they change."""
    velocities = between(streams.velocities, window.begin_ns, window.end_ns)
    counters = between(streams.mileages, window.begin_ns, window.end_ns)
    if len(velocities) < LEAST or len(counters) < 2 or not comparable(counters[0], counters[-1]):
        return None
    span_s = (counters[-1].mono_ns - counters[0].mono_ns) / NS_PER_S
    turn = sum(math.remainder(b.heading - a.heading, math.tau) for a, b in pairwise(counters))
    counted = Twist((counters[-1].distance - counters[0].distance) / span_s, turn / span_s)
    half = len(velocities) // 2
    earlier, measured = _mean(velocities[:half]), _mean(velocities)
    if not (
        isclose(earlier.linear, measured.linear, rel_tol=SAME, abs_tol=SAME_TWIST.linear)
        and isclose(earlier.angular, measured.angular, rel_tol=SAME, abs_tol=SAME_TWIST.angular)
    ):
        return None
    return Speeds(Twist(window.motions[0].linear, window.motions[0].angular), measured, counted)


def _mean(velocities: Sequence[Velocity]) -> Twist:
    return Twist(mean(map(_linear, velocities)), mean(map(_angular, velocities)))


def _changes(drive: Sequence[Motion], span: float, of: Component) -> bool:
    """Return whether the commanded speed changes by this much."""
    commands = [of(motion) for motion in drive]
    return max(commands) - min(commands) >= span


def _rise(streams: Streams, drive: Sequence[Motion], of: Component) -> float | None:
    """Return the greatest change of the measured speed in ``RISE`` velocities, per second."""
    velocities = between(streams.velocities, drive[0].mono_ns, drive[-1].mono_ns)
    rises = [
        (abs(of(b)) - abs(of(a))) / (b.mono_ns - a.mono_ns) * NS_PER_S
        for a, b in zip(velocities, velocities[RISE:], strict=False)
    ]
    return max(rises, default=None)


def _fall(streams: Streams, drive: Sequence[Motion], of: Component) -> float | None:
    """Return the ratio of the measured slow-down at the end of a drive to the commanded one."""
    commands = [(one.mono_ns, abs(of(one))) for one in drive]
    top = max(speed for _, speed in commands)
    begin = max(at for at, (_, speed) in enumerate(commands) if speed == top)
    velocities = between(streams.velocities, commands[begin][0], commands[-1][0])
    measured = [(one.mono_ns, abs(of(one))) for one in velocities]
    if commands[-1][1] > top / 2 or len(measured) < LEAST:
        return None
    commanded = _slope(commands[begin:], FALLEN * top)
    return _slope(measured, FALLEN * top) / commanded if commanded > 0 else None


def _slope(speeds: Sequence[tuple[int, float]], below: float) -> float:
    """Return the fall of a speed per second, from where it is below a value to the end."""
    slow = [each for each in speeds if each[1] <= below]
    (begin_ns, high), (end_ns, low) = (slow if len(slow) >= LEAST else speeds)[0], speeds[-1]
    return (high - low) / (end_ns - begin_ns) * NS_PER_S if end_ns > begin_ns else 0.0


def _delay_s(streams: Streams, drive: Sequence[Motion], of: Component) -> float | None:
    """Return the delay that explains a drive best; None without enough velocities."""
    commands = [of(motion) for motion in drive]
    velocities = between(streams.velocities, drive[0].mono_ns, drive[-1].mono_ns)
    if len(velocities) < LEAST:
        return None

    def error(step: int) -> float:
        late_ns = round(step * DELAY_STEP_S * NS_PER_S)
        total, at = 0.0, 0
        for velocity in velocities:
            while at + 1 < len(drive) and drive[at + 1].mono_ns <= velocity.mono_ns - late_ns:
                at += 1
            begun = drive[0].mono_ns <= velocity.mono_ns - late_ns
            total += ((commands[at] if begun else 0.0) - of(velocity)) ** 2
        return total

    return min(range(DELAYS), key=error) * DELAY_STEP_S
