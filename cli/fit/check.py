"""The fitted vehicle under the recorded commands: whether the model explains a recording. Pure.

The model's motors follow the newest recorded motion, as the board does, until the bridge's lease
ends. Nothing else is taken from the recording but the time: a model that drifts away says so.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import mean

from msgspec import Struct

from cli.fit.stops import Stop
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from common.standstill import comparable
from common.wire.commands import MotionKind
from sim.model import Model
from sim.vehicle import Motors
from t2.messages import Command, Motion

STEP_S = 0.01  # of the simulated motors
STEP_NS = round(STEP_S * NS_PER_S)
LEASE_NS = NS_PER_S // 5  # the bridge obeys a motion for so long
LONGEST = 3000  # steps of a stop
KINDS = {
    Command.RUN: MotionKind.RUN,
    Command.STOP: MotionKind.STOP,
    Command.BRAKE: MotionKind.BREAK,
}
# Allowed differences: shares of the distance, the turn and the stops' distances, and of the speed
# that the vehicle has on average while it moves.
DISTANCE, TURN, STOPS, SPEED = 0.05, 0.10, 0.15, 0.15


@dataclass(slots=True)
class Course:
    """Speeds of the model over the recording's time."""

    times: list[int] = field(default_factory=list)  # ns, monotonic
    twists: list[Twist] = field(default_factory=list)


class Difference(Struct, frozen=True, kw_only=True):
    """One quantity as recorded, and as the model has it."""

    name: str
    unit: str
    recorded: float
    modelled: float
    allowed: float  # share of what was recorded

    @property
    def share(self) -> float:
        """Difference as a share of what was recorded."""
        return abs(self.modelled - self.recorded) / self.recorded if self.recorded else 0.0

    @property
    def is_explained(self) -> bool:
        """Whether the difference is allowed."""
        return self.share <= self.allowed


def follow(motions: Sequence[Motion], model: Model) -> Course:
    """Return how the model follows the recorded motions, from a standstill on."""
    motors, course, twist = Motors(model.drive, model.vehicle.track), Course(), STILL
    at_ns = motions[0].mono_ns
    for now, after in pairwise(motions):
        while at_ns < after.mono_ns:
            is_obeyed = at_ns - now.mono_ns < LEASE_NS
            kind = KINDS[now.command] if is_obeyed else MotionKind.STOP
            twist = motors.follow(twist, kind, Twist(now.linear, now.angular), STEP_S)
            course.times.append(at_ns)
            course.twists.append(twist)
            at_ns += STEP_NS
    return course


def compare(
    streams: Streams, stops: Sequence[Stop], model: Model
) -> tuple[Course, list[Difference]]:
    """Return the model's course, and its differences from the recording.

    Raise ``ValueError`` without motions to follow.
    """
    if len(streams.motions) < 2:
        raise ValueError("has a single motion")
    course = follow(streams.motions, model)
    linear = [abs(twist.linear) for twist in course.twists]
    angular = [abs(twist.angular) for twist in course.twists]
    way, turn = counted(streams)
    rows = [("distance", "m", way, sum(linear) * STEP_S, DISTANCE),
            ("turn", "rad", turn, sum(angular) * STEP_S, TURN)]  # fmt: skip
    for name, unit, of in (("m/s", "m/s", 0), ("rad/s", "rad/s", 1)):
        if row := _speed(streams, course, of):
            rows.append((f"speed while moving, {name}", unit, *row, SPEED))
    for unit in ("m", "rad"):
        mine = [stop for stop in stops if stop.axis.unit == unit]
        if mine:
            modelled = mean(stopped_within(stop, model) for stop in mine)
            rows.append((f"stops, {unit}", unit, mean(s.distance for s in mine), modelled, STOPS))
    return course, [
        Difference(name=name, unit=unit, recorded=recorded, modelled=modelled, allowed=allowed)
        for name, unit, recorded, modelled, allowed in rows
    ]


def counted(streams: Streams) -> tuple[float, float]:
    """Return the counted distance (m) and turn (rad), both without their signs."""
    steps = [pair for pair in pairwise(streams.mileages) if comparable(*pair)]
    way = sum(abs(b.distance - a.distance) for a, b in steps)
    turn = sum(abs(math.remainder(b.heading - a.heading, math.tau)) for a, b in steps)
    return way, turn


def stopped_within(stop: Stop, model: Model) -> float:
    """Return the distance (m or rad) that the model needs for a recorded stop."""
    motors, twist, distance = Motors(model.drive, model.vehicle.track), stop.twist, 0.0
    kind = MotionKind.STOP if stop.kind == "stop" else MotionKind.BREAK
    for _ in range(round(model.drive.dead_time / STEP_S) + 1):
        motors.follow(twist, MotionKind.RUN, twist, STEP_S)
    for _ in range(LONGEST):
        twist = motors.follow(twist, kind, STILL, STEP_S)
        if twist.is_standing:
            break
        distance += abs(twist.linear if stop.axis.unit == "m" else twist.angular) * STEP_S
    return distance


def lines(differences: Sequence[Difference]) -> Iterator[str]:
    """Yield the comparison as text."""
    for each in differences:
        mark = "" if each.is_explained else f", more than {each.allowed:.0%}: NOT EXPLAINED"
        yield (
            f"{each.name}: recorded {each.recorded:.3f} {each.unit}, model {each.modelled:.3f} "
            f"{each.unit} ({each.share:.1%}{mark})"
        )
    if all(each.is_explained for each in differences):
        yield "The model explains the recording."
    else:
        yield "The model does NOT explain the recording: do not trust a simulation with it."


def _speed(streams: Streams, course: Course, axis: int) -> tuple[float, float] | None:
    """Return the mean measured speed while moving, and the same plus the model's mean error."""
    at, measured, errors = 0, [], []
    for velocity in streams.velocities:
        while at + 1 < len(course.times) and course.times[at + 1] <= velocity.mono_ns:
            at += 1
        if not course.times or Twist(velocity.linear, velocity.angular).is_standing:
            continue
        real = (velocity.linear, velocity.angular)[axis]
        model = (course.twists[at].linear, course.twists[at].angular)[axis]
        if abs(real) > abs((velocity.angular, velocity.linear)[axis]):
            measured.append(abs(real))
            errors.append(abs(real - model))
    return (mean(measured), mean(measured) + mean(errors)) if measured else None
