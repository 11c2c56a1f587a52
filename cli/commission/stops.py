"""Stops in the recorded messages of a vehicle: speed, reaction time, deceleration, distance. Pure.

A stop begins with the first STOP or BRAKE after a RUN with speed and ends with the second of two
consecutive velocities below the standstill threshold. All times are those of the robot's monotonic
clock, so a late recorder changes nothing. A line through the velocities between 90 % and 10 % of
the speed has two results::

    speed ______
                \\          reaction: from the command until the line falls below the speed
                 \\         deceleration: slope of the line
    command      \\____

When BRAKE follows a STOP that takes too long, the line ends there, and the stop counts as STOP.
With fewer than three velocities on the slope the line connects the two velocities around it, so
that the deceleration is a lower bound. The distance comes from the board's counters. Velocities are
in steps of 1 mm/s, counters of 1 mm.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import linear_regression, median
from typing import Literal

from common.freshness import NS_PER_S
from common.messages import Bumper, Direction, Message, Mileage, Motion, Velocity
from common.motion import Command, Twist, is_standing

SLOWEST_MPS = 0.1
STEADY_S, STEADY_MPS, STEADY = 0.2, 0.03, 0.05  # before the command: time, deviation, relative one
TURNING_RADPS = 0.1
LONGEST_GAP_S = 0.1  # between two velocities, and around the begin of a stop
COUNTED_S = 0.2  # from standstill to the counters' next value
COARSEST_S = 0.03  # between two velocities; 50 Hz have 0.02 s
UPPER, LOWER = 0.9, 0.1  # of the speed: the part of the slope that is used
SLOPE = 3  # velocities on it
NO_VELOCITIES, NO_COUNTERS = "velocities are missing", "counters are missing"

Kind = Literal["stop", "brake"]
Point = tuple[float, float]  # s since the command, m/s in the direction of the motion


@dataclass(slots=True)
class Streams:
    """The messages of one recording that matter here."""

    motions: list[Motion] = field(default_factory=list)
    velocities: list[Velocity] = field(default_factory=list)
    mileages: list[Mileage] = field(default_factory=list)
    bumpers: list[Bumper] = field(default_factory=list)

    def add(self, message: Message) -> None:
        """Add the next message; other types are ignored."""
        match message:
            case Motion():
                self.motions.append(message)
            case Velocity():
                self.velocities.append(message)
            case Mileage():
                self.mileages.append(message)
            case Bumper():
                self.bumpers.append(message)

    @property
    def period_s(self) -> float:
        """Median time between two velocities: the resolution of a reaction time."""
        steps = [b.mono_ns - a.mono_ns for a, b in pairwise(self.velocities)]
        return median(steps) / NS_PER_S if steps else 0.0

    @property
    def problem(self) -> str:
        """Reason why no stop can be measured, or an empty string."""
        needed: dict[str, Sequence[Message]] = {
            "@cmd/motion": self.motions,
            "tel/bridge/velocity": self.velocities,
            "tel/bridge/mileage": self.mileages,
        }
        missing = [name for name, messages in needed.items() if not messages]
        if missing:
            return f"has no {' and no '.join(missing)}: record all keys with `t2 record`"
        if len({each.host for messages in needed.values() for each in messages}) > 1:
            return (
                "has messages of several hosts, or of two boots of one: their clocks do not agree"
            )
        if self.period_s > COARSEST_S:
            return (
                f"has a velocity each {self.period_s:.2f} s, too coarse for a stop: laptops get "
                "downsampled streams over TLS (bus.laptop_rate), so record on the robot"
            )
        return ""


@dataclass(frozen=True, slots=True)
class Stop:
    """One measured stop."""

    kind: Kind
    direction: Direction
    speed: float  # m/s, at the command
    reaction: float  # s
    deceleration: float  # m/s^2
    distance: float  # m, by the counters, from the command to standstill
    braked: bool = False  # BRAKE followed the STOP before standstill
    file: str = ""
    command: tuple[int, int] = (0, 0)  # boot of safety and time; the same in two recordings of it


@dataclass(frozen=True, slots=True)
class Begin:
    """The command of a stop, and what followed: BRAKE after STOP, and any other command."""

    kind: Kind
    at_ns: int
    boot: int  # of safety
    brake: Motion | None
    other: Motion | None


class UnsuitableError(Exception):
    """A stop that shows nothing about the vehicle; the text is the reason."""


def find_stops(streams: Streams, file: str = "") -> tuple[list[Stop], Counter[str]]:
    """Return the measured stops, and how many were left out for which reason."""
    found: list[Stop] = []
    left_out: Counter[str] = Counter()
    for begin in begins(streams.motions):
        try:
            found.append(measure(streams, begin, file))
        except UnsuitableError as reason:
            left_out[str(reason)] += 1
    return found, left_out


def begins(motions: Sequence[Motion]) -> Iterator[Begin]:
    """Yield the commands that end a RUN with speed."""
    for index, (before, now) in enumerate(pairwise(motions), 1):
        if now.command is Command.RUN or not _runs(before):
            continue
        kind: Kind = "brake" if now.command is Command.BRAKE else "stop"
        later = motions[index + 1 :]
        brake = (m for m in later if kind == "stop" and m.command is Command.BRAKE)
        other = (m for m in later if m.command not in (now.command, Command.BRAKE))
        yield Begin(kind, now.mono_ns, now.boot, next(brake, None), next(other, None))


def measure(streams: Streams, begin: Begin, file: str) -> Stop:
    """Return a stop; raise ``UnsuitableError`` if it is left out."""
    window = _until_standstill(streams.velocities, begin)
    end_ns = window[-1].mono_ns
    if any(b.pressed and begin.at_ns <= b.mono_ns <= end_ns for b in streams.bumpers):
        raise UnsuitableError("the bumper was pressed")
    distance = _distance(streams.mileages, begin.at_ns, end_ns)
    sign = 1 if window[0].linear > 0 else -1
    speed = abs(window[0].linear)
    brake = begin.brake
    braked = brake is not None and brake.mono_ns <= end_ns
    part = window
    if brake is not None:
        part = [v for v in window if v.mono_ns <= brake.mono_ns]
    reaction, deceleration = slope([(_s(v, begin), sign * v.linear) for v in part], speed)
    direction: Direction = "forward" if sign > 0 else "backward"
    return Stop(
        begin.kind,
        direction,
        speed,
        reaction,
        deceleration,
        distance,
        braked,
        file,
        command=(begin.boot, begin.at_ns),
    )


def slope(points: Sequence[Point], speed: float) -> tuple[float, float]:
    """Return reaction time (s) and deceleration (m/s^2) from the first point to standstill."""
    above = max(n for n, (_, v) in enumerate(points) if n == 0 or v > UPPER * speed)
    slow = (n for n, (_, v) in enumerate(points) if n > above and v < LOWER * speed)
    below = next(slow, len(points))
    part = points[above + 1 : below]
    if len(part) < SLOPE:
        if below == len(points):
            raise UnsuitableError("changed to BRAKE before it slowed down")
        part = (points[above], points[below])
    rate, at_zero = linear_regression([s for s, _ in part], [v for _, v in part])
    if rate >= 0:
        raise UnsuitableError("the speed does not fall steadily")
    return (speed - at_zero) / rate, -rate


def _runs(motion: Motion) -> bool:
    return motion.command is Command.RUN and not Twist(motion.linear, motion.angular).rounds_to_zero


def _until_standstill(velocities: Sequence[Velocity], begin: Begin) -> Sequence[Velocity]:
    """Return the velocities of a stop, from the newest one at its command."""
    first = bisect_right(velocities, begin.at_ns, key=lambda v: v.mono_ns) - 1
    if first < 0 or _s(velocities[first], begin) < -LONGEST_GAP_S:
        raise UnsuitableError(NO_VELOCITIES)
    _check_begin(velocities, velocities[first])
    stand = (n for n in range(first + 2, len(velocities)) if _stands(velocities[n - 1 : n + 1]))
    end = next(stand, len(velocities) - 1)
    window = velocities[first : end + 1]
    if begin.other is not None and begin.other.mono_ns <= window[-1].mono_ns:
        raise UnsuitableError(f"changed to {begin.other.command.upper()} before standstill")
    if not _stands(window[-2:]):
        raise UnsuitableError("the recording ends before standstill")
    if any(b.mono_ns - a.mono_ns > LONGEST_GAP_S * NS_PER_S for a, b in pairwise(window)):
        raise UnsuitableError(NO_VELOCITIES)
    return window


def _s(message: Message, begin: Begin) -> float:
    return (message.mono_ns - begin.at_ns) / NS_PER_S


def _stands(velocities: Sequence[Velocity]) -> bool:
    return all(is_standing(v.linear, v.angular) for v in velocities)


def _check_begin(velocities: Sequence[Velocity], first: Velocity) -> None:
    """Check the motion before the command."""
    speed = abs(first.linear)
    if speed < SLOWEST_MPS:
        raise UnsuitableError(f"slower than {SLOWEST_MPS:g} m/s")
    if abs(first.angular) > TURNING_RADPS:
        raise UnsuitableError("turning")
    since_ns = first.mono_ns - round(STEADY_S * NS_PER_S)
    before = [v.linear for v in velocities if since_ns <= v.mono_ns <= first.mono_ns]
    most = max(STEADY_MPS, STEADY * speed)
    if any(abs(v - first.linear) > most for v in before):
        raise UnsuitableError("not at a steady speed")


def _distance(mileages: Sequence[Mileage], begin_ns: int, end_ns: int) -> float:
    """Return the counted distance (m)."""
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
    return abs(end.distance - before.distance - share * (after.distance - before.distance))
