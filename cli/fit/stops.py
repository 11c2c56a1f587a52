"""Stops in the streams of a vehicle: speed, reaction time, deceleration, distance. Pure.

A stop begins with the first STOP or BRAKE after a RUN with speed and ends with the second of two
consecutive velocities below the standstill threshold. Driving and turning are measured one by one:
a stop in a curve is one of each, in m and in rad. A line through the velocities between 90 % and
10 % of the speed has two results::

    speed ______
                \\          reaction: from the command until the line falls below the speed
                 \\         deceleration: slope of the line
    command      \\____

When BRAKE follows a STOP that takes too long, the line ends there, and the stop counts as STOP.
With fewer than three velocities on the slope the line connects the two velocities around it, so
that the deceleration is a lower bound. The distance comes from the board's counters. Velocities are
in steps of 1 mm/s and 0.1 deg/s, counters of 1 mm and 0.1 deg.
"""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile
from math import isclose, isfinite, nan, radians, remainder, tau
from statistics import linear_regression, mean
from typing import Literal

from cli.fit.streams import Streams, between
from common.freshness import NS_PER_S
from common.motion import STANDING_MPS, STANDING_RADPS, Twist
from t2.messages import Command, Mileage, Motion, Velocity

STEADY_S, STEADY = 0.2, 0.05  # before the command: time, and relative deviation
LONGEST_GAP_S = 0.1  # between two velocities, and around the begin of a stop
COUNTED_S = 0.2  # from standstill to the counters' next value
UPPER, LOWER = 0.9, 0.1  # of the speed: the part of the slope that is used
SLOPE = 3  # velocities on it
AGAINST = 0.005  # m or rad, steps of the counters
NO_VELOCITIES, NO_COUNTERS = "velocities are missing", "counters are missing"

Kind = Literal["stop", "brake"]
Point = tuple[float, float]  # s since the command, m/s in the direction of the motion


@dataclass(frozen=True, slots=True)
class Axis:
    """What is measured of a stop: driving, or turning."""

    unit: str
    directions: dict[float, str]  # by the sign of the speed
    slowest: float  # of the unit per second, as the next two
    steady: float  # deviation before the command
    standing: float
    resolution: float  # of a velocity
    speed: Callable[[Velocity | Twist], float]
    travel: Callable[[Mileage, Mileage], float]  # from one reading of the counters to the next

    def runs(self, velocity: Twist) -> bool:
        """Return whether the vehicle moves fast enough to show a stop."""
        return abs(self.speed(velocity)) >= self.slowest


DRIVING = Axis(
    "m",
    {1: "forward", -1: "backward"},
    slowest=0.1,
    steady=0.03,
    standing=STANDING_MPS,
    resolution=0.001,
    speed=lambda velocity: velocity.linear,
    travel=lambda before, after: after.distance - before.distance,
)
TURNING = Axis(
    "rad",
    {1: "left", -1: "right"},
    slowest=0.2,
    steady=0.05,
    standing=STANDING_RADPS,
    resolution=radians(0.1),
    speed=lambda velocity: velocity.angular,
    travel=lambda before, after: remainder(after.heading - before.heading, tau),
)


@dataclass(frozen=True, slots=True)
class Stop:
    """One measured stop."""

    axis: Axis
    kind: Kind
    direction: str
    speed: float  # m/s or rad/s, up to the command
    twist: Twist  # the same, of both axes
    reaction: float  # s; NaN if the vehicle did not slow down steadily, as the next one
    deceleration: float  # m/s^2 or rad/s^2
    distance: float  # m or rad, by the counters, from the command to standstill
    points: tuple[Point, ...]  # the velocities from the command to standstill
    at_ns: int  # wall clock at the command
    braked: bool = False  # BRAKE followed the STOP before standstill
    is_whole: bool = True  # False if the recording lacks its begin: it needed more than this
    commanded: float = nan  # greatest speed in the 0.2 s before, in which the speed was measured
    integrated: float = nan  # m or rad, by the velocities, from the command to standstill

    @property
    def is_steady(self) -> bool:
        """Whether the vehicle slowed down steadily by this command."""
        return isfinite(self.deceleration)

    @property
    def is_curve(self) -> bool:
        """Whether the vehicle drove and turned."""
        return DRIVING.runs(self.twist) and TURNING.runs(self.twist)


class UnsuitableError(Exception):
    """A stop that shows nothing about the vehicle; the text is the reason."""


def find_stops(streams: Streams) -> tuple[list[Stop], Counter[str]]:
    """Return the measured stops, and how many were left out for which reason."""
    found: list[Stop] = []
    left_out: Counter[str] = Counter()
    for motions in _begins(streams.motions):
        try:
            found += _measured(streams, motions)
        except UnsuitableError as reason:
            left_out[str(reason)] += 1
    return found, left_out


def counted(reasons: Counter[str]) -> str:
    """Return reasons with their counts as text."""
    return ", ".join(f"{count} {reason}" for reason, count in reasons.most_common())


def slope(
    points: Sequence[Point], speed: float, standing: float = STANDING_MPS
) -> tuple[float, float]:
    """Return reaction time (s) and deceleration, from this speed to standstill.

    Both are NaN if the vehicle did not slow down, or not steadily.
    """
    above = [n for n, (_, v) in enumerate(points) if v > UPPER * speed]
    falling = points[above[-1] if above else 0 :]
    lowest = max(LOWER * speed, standing)
    part = list(takewhile(lambda point: point[1] >= lowest, falling))
    below = falling[len(part) :]
    if len(part) > SLOPE:
        part = part[1:]
    elif below:
        part = [falling[0], below[0]]
    else:
        return nan, nan
    rate, at_zero = linear_regression([s for s, _ in part], [v for _, v in part])
    if rate >= 0:
        return nan, nan
    return (speed - at_zero) / rate, -rate


def _begins(motions: Sequence[Motion]) -> Iterator[Sequence[Motion]]:
    """Yield the motions from each RUN with speed on that a command ends."""
    for index, (before, now) in enumerate(pairwise(motions), 1):
        ran = not Twist(before.linear, before.angular).rounds_to_zero
        if before.command is Command.RUN and ran and now.command is not Command.RUN:
            yield motions[index - 1 :]


def _measured(streams: Streams, motions: Sequence[Motion]) -> list[Stop]:
    """Return the stop that the second of these motions commands, of each axis that moved."""
    run, command = motions[:2]
    # An earlier command may have been lost, or the bridge's lease was over before it.
    follows = (run.boot, run.seq + 1) == (command.boot, command.seq)
    is_whole = follows and command.mono_ns - run.mono_ns <= LONGEST_GAP_S * NS_PER_S
    first = bisect_right(streams.velocities, command.mono_ns, key=lambda v: v.mono_ns)
    if first == 0:
        raise UnsuitableError(NO_VELOCITIES)
    twist = _steady(streams.velocities[:first])
    window = _until_standstill(streams.velocities[first - 1 :], motions[1:])
    axes = [axis for axis in (DRIVING, TURNING) if axis.runs(twist)]
    stops = [_measure(streams, motions, twist, window, axis) for axis in axes]
    return [replace(stop, is_whole=is_whole) for stop in stops]


def _measure(
    streams: Streams,
    motions: Sequence[Motion],
    twist: Twist,
    window: Sequence[Velocity],
    axis: Axis,
) -> Stop:
    """Return one axis of the stop that the second of these motions commands."""
    (run, command), end_ns = motions[:2], window[-1].mono_ns
    if any(b.pressed and command.mono_ns <= b.mono_ns <= end_ns for b in streams.bumpers):
        raise UnsuitableError("the bumper was pressed")
    kind: Kind = "brake" if command.command is Command.BRAKE else "stop"
    brakes = [m.mono_ns for m in motions if m.command is Command.BRAKE and m.mono_ns <= end_ns]
    braked = kind == "stop" and bool(brakes)
    last_ns = brakes[0] if braked else end_ns
    speed = abs(axis.speed(twist))
    sign = axis.speed(twist) / speed
    points = [
        ((v.mono_ns - command.mono_ns) / NS_PER_S, sign * axis.speed(v))
        for v in window
        if v.mono_ns <= last_ns
    ]
    distance = sign * _distance(streams.mileages, command.mono_ns, end_ns, axis)
    if distance < -AGAINST:
        raise UnsuitableError("velocity and counters have opposite signs")
    reaction, deceleration = slope(points, speed, axis.standing)
    since_ns = min(run.mono_ns, command.mono_ns - round(STEADY_S * NS_PER_S))
    before = between(streams.motions, since_ns, run.mono_ns)
    return Stop(
        axis=axis, kind=kind, direction=axis.directions[sign], speed=speed, twist=twist,
        reaction=reaction, deceleration=deceleration, distance=abs(distance),
        commanded=max(sign * axis.speed(Twist(each.linear, each.angular)) for each in before),
        integrated=_integrated(window, command.mono_ns, sign, axis),
        points=tuple(points), at_ns=command.t_ns, braked=braked,
    )  # fmt: skip


def _integrated(window: Sequence[Velocity], begin_ns: int, sign: float, axis: Axis) -> float:
    """Return the distance (m or rad) by the velocities from a time on."""
    return sum(
        sign
        * (axis.speed(a) + axis.speed(b))
        / 2
        * (b.mono_ns - max(begin_ns, a.mono_ns))
        / NS_PER_S
        for a, b in pairwise(window)
    )


def _until_standstill(
    velocities: Sequence[Velocity], motions: Sequence[Motion]
) -> Sequence[Velocity]:
    """Return the velocities of a stop; the first one is the newest at its command."""
    command = motions[0]
    other = next((m for m in motions if m.command not in (command.command, Command.BRAKE)), None)
    window = [velocities[0]]
    for before, now in pairwise(velocities):
        if now.mono_ns - before.mono_ns > LONGEST_GAP_S * NS_PER_S:
            raise UnsuitableError(NO_VELOCITIES)
        if other is not None and other.mono_ns <= now.mono_ns:
            raise UnsuitableError(f"changed to {other.command.upper()} before standstill")
        window.append(now)
        if all(Twist(v.linear, v.angular).is_standing for v in (before, now)):
            return window
    raise UnsuitableError("the recording ends before standstill")


def _steady(velocities: Sequence[Velocity]) -> Twist:
    """Return the steady velocity up to the command: the mean of the last ones."""
    since_ns = velocities[-1].mono_ns - round(STEADY_S * NS_PER_S)
    recent = velocities[bisect_left(velocities, since_ns, key=lambda v: v.mono_ns) :]
    middle = len(recent) // 2
    earlier, later = _mean(recent[: middle + 1]), _mean(recent[middle:])
    axes = [axis for axis in (DRIVING, TURNING) if axis.runs(_mean(recent))]
    if not axes:
        raise UnsuitableError(f"slower than {DRIVING.slowest:g} m/s and {TURNING.slowest:g} rad/s")
    for axis in axes:
        if not isclose(axis.speed(earlier), axis.speed(later), rel_tol=STEADY, abs_tol=axis.steady):
            raise UnsuitableError("not at a steady speed")
    return _mean(recent)


def _mean(velocities: Sequence[Velocity]) -> Twist:
    return Twist(mean(v.linear for v in velocities), mean(v.angular for v in velocities))


def _distance(mileages: Sequence[Mileage], begin_ns: int, end_ns: int, axis: Axis) -> float:
    """Return the counted distance (m or rad) with its sign; of a turn the sum of its steps."""
    first = bisect_right(mileages, begin_ns, key=lambda m: m.mono_ns)
    last = bisect_right(mileages, end_ns, key=lambda m: m.mono_ns)
    if first == 0 or last == len(mileages):
        raise UnsuitableError(NO_COUNTERS)
    before, after, end = mileages[first - 1], mileages[first], mileages[last]
    if max(after.mono_ns - before.mono_ns, end.mono_ns - end_ns) > COUNTED_S * NS_PER_S:
        raise UnsuitableError(NO_COUNTERS)
    if len({(m.boot, m.epoch) for m in mileages[first - 1 : last + 1]}) > 1:
        raise UnsuitableError("bridge or board restarted")
    share = (begin_ns - before.mono_ns) / (after.mono_ns - before.mono_ns)
    steps = [axis.travel(*pair) for pair in pairwise(mileages[first - 1 : last + 1])]
    return sum(steps) - share * steps[0]
