"""The lap as a list of steps, each with its drive request and its end condition. Pure.

Coordinates are in the frame ``odom``, whose origin is the start; the world is
``sim/worlds/office.toml``. A step that safety stops waits and continues. A latch outside the plan
is reset and counted.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from common.freshness import NS_PER_S
from common.messages import Odometry, SafetyState
from common.motion import STILL, Twist, clamp, is_standing

UNDER_WAY = 0.5  # m; a shorter way means blocked at the start, before the first sonar message

Press = Literal["reset", "release"]
HeadingError = Callable[[Odometry], float]  # rad to turn, counter-clockwise


@dataclass(frozen=True, slots=True)
class Pace:
    """Speeds and tolerances of the driver."""

    cruise: float  # m/s
    careful: float  # m/s
    spin: float  # rad/s
    gain: float  # 1/s, from an error in heading to a turning rate
    facing: float  # rad, allowed heading error


QUICK = Pace(0.8, 0.4, 0.8, 2.0, 0.03)
# For a host with scheduling stalls: measurements are old when the driver acts on them.
PATIENT = Pace(0.5, 0.25, 0.3, 0.7, 0.08)


@dataclass(frozen=True, slots=True)
class View:
    """Input of the driver at one time."""

    odometry: Odometry
    safety: SafetyState
    pressed: bool  # the bumper
    refusal: str | None = None  # of the last call in this step
    granted: bool = False  # likewise

    @property
    def causes(self) -> frozenset[str]:
        """The names of safety's causes."""
        return frozenset(cause.name for cause in self.safety.causes)

    @property
    def standing(self) -> bool:
        """Whether the vehicle stands, by odometry."""
        return is_standing(self.odometry.linear, self.odometry.angular)


@dataclass(frozen=True, slots=True)
class Step:
    """One part of the lap."""

    name: str
    drive: Callable[[View, Odometry], Twist]  # input, and the pose at the start of the step
    done: Callable[[View, Odometry], bool]
    press: Press | None = None
    latched: bool = False  # the step expects a latch


@dataclass(frozen=True, slots=True)
class Action:
    """Output of the driver at one time."""

    twist: Twist = STILL
    press: Press | None = None


@dataclass(slots=True)
class Lap:
    """State of the lap; ``advance`` is its only transition."""

    steps: tuple[Step, ...]
    index: int = 0
    began: Odometry | None = None
    times_ns: list[int] = field(default_factory=list)  # when each step began
    unplanned: list[str] = field(default_factory=list)  # latches outside the plan
    recovering: tuple[str, ...] = ()  # latches being reset

    @property
    def step(self) -> Step | None:
        """The current step; None at the end."""
        return self.steps[self.index] if self.index < len(self.steps) else None

    def advance(self, view: View, now_ns: int) -> Action:
        """Return the action for the input, and move to the next step when this one is done."""
        if self.step is None:
            return Action()
        if self.began is None:
            self.began = view.odometry
            self.times_ns.append(now_ns)
        if self.step.done(view, self.began):
            self.index += 1
            self.began = None
            return Action()
        if view.safety.latched and not self.step.latched:
            return self._recover(view.safety.latched)
        self.recovering = ()
        if "neutral" in view.causes:
            return Action(press=self.step.press)
        return Action(self.step.drive(view, self.began), self.step.press)

    def seconds(self, now_ns: int) -> float:
        """Return the duration of the lap so far."""
        return (now_ns - self.times_ns[0]) / NS_PER_S if self.times_ns else 0.0

    def _recover(self, latched: tuple[str, ...]) -> Action:
        if self.recovering != latched:
            self.recovering = latched
            self.unplanned.append(", ".join(latched))
        return Action(press="reset")


def lap(fast: bool, pace: Pace = QUICK) -> tuple[Step, ...]:
    """Return the steps; the fast lap ends before the drive home."""
    to_north, to_east = heading_error(math.pi / 2), heading_error(0.0)
    first = (
        Step("wait for safety", still, lambda v, _: v.safety.verdict in ("run", "slow")),
        Step("drive off to the wall", ahead(pace, pace.cruise), blocked),
        Step("back off", ahead(pace, -pace.careful), moved_by(0.45)),
        Step("turn left", turn(pace, to_north), faces(pace, to_north)),
        Step("drive on", ahead(pace, pace.cruise), lambda v, _: "contact" in v.safety.latched),
        Step("reset, refused", still, lambda v, _: v.refusal is not None, "reset", latched=True),
        Step("release", still, released, "release", latched=True),
        Step("reset", still, lambda v, _: not v.safety.latched, "reset", latched=True),
        Step("back off", ahead(pace, -pace.careful), moved_by(0.6)),
    )
    if fast:
        return first
    return (
        *first,
        Step("turn home", turn(pace, bearing), faces(pace, bearing)),
        Step("drive home", toward_start(pace), is_home),
        Step("turn as at the start", turn(pace, to_east), faces(pace, to_east)),
    )


def still(_: View, __: Odometry) -> Twist:
    """Request zero."""
    return STILL


def ahead(pace: Pace, linear: float) -> Callable[[View, Odometry], Twist]:
    """Request straight motion that keeps the heading at the start of the step."""

    def drive(view: View, began: Odometry) -> Twist:
        error = wrap(began.heading - view.odometry.heading)
        return Twist(linear, clamp(pace.gain * error, 0.3))

    return drive


def turn(pace: Pace, error: HeadingError) -> Callable[[View, Odometry], Twist]:
    """Request a turn on the spot until the error is 0."""
    return lambda view, _: Twist(0.0, clamp(pace.gain * error(view.odometry), pace.spin))


def toward_start(pace: Pace) -> Callable[[View, Odometry], Twist]:
    """Request motion to the start, slower when close."""

    def drive(view: View, _: Odometry) -> Twist:
        error = bearing(view.odometry)
        slower = 0.4 * pace.gain * distance(view.odometry, 0.0, 0.0)
        speed = min(pace.cruise, slower) if abs(error) < 0.5 else 0.0
        return Twist(speed, clamp(pace.gain * error, pace.spin))

    return drive


def blocked(view: View, began: Odometry) -> bool:
    """Return whether safety has stopped the vehicle before an obstacle."""
    under_way = distance(view.odometry, began.x, began.y) > UNDER_WAY
    return under_way and "blocked" in view.causes and view.standing


def moved_by(metres: float) -> Callable[[View, Odometry], bool]:
    """Return a condition: distance from the start of the step reached."""
    return lambda view, began: distance(view.odometry, began.x, began.y) >= metres


def faces(pace: Pace, error: HeadingError) -> Callable[[View, Odometry], bool]:
    """Return a condition: standstill with a small error."""
    return lambda view, _: abs(error(view.odometry)) < pace.facing and view.standing


def is_home(view: View, _: Odometry) -> bool:
    """Return whether the vehicle is at the start."""
    return distance(view.odometry, 0.0, 0.0) < 0.1


def released(view: View, began: Odometry) -> bool:
    """Return whether the bumper is free, and the vehicle has crept a little more or must not."""
    crept = distance(view.odometry, began.x, began.y)
    return not view.pressed and (crept > 0.05 or view.refusal is not None)


def distance(pose: Odometry, x: float, y: float) -> float:
    """Return the distance to a point, m."""
    return math.hypot(x - pose.x, y - pose.y)


def heading_error(heading: float) -> HeadingError:
    """Return the function that measures the turn to a heading (rad)."""
    return lambda pose: wrap(heading - pose.heading)


def bearing(pose: Odometry) -> float:
    """Return the bearing of the start, rad, counter-clockwise."""
    return wrap(math.atan2(-pose.y, -pose.x) - pose.heading)


def wrap(angle: float) -> float:
    """Return an angle wrapped to -pi..pi."""
    return math.remainder(angle, math.tau)
