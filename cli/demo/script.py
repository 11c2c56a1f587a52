"""The lap as a list of steps: what is asked for in each, and when it is over.

Coordinates are those of ``sim/worlds/office.toml``, in ``odom``, which begins where the vehicle
starts. A step that is stopped for a passing reason waits and goes on; a latch that the lap did not
mean to cause is reset and counted.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from common.freshness import NS_PER_S
from common.messages import Odometry, SafetyState
from common.motion import STILL, Twist, clamp, is_standing

UNDER_WAY = 0.5  # m; before that it is the start that is blocked, by a sonar not heard yet

Press = Literal["reset", "release"]


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast the driver dares to be."""

    cruise: float  # m/s
    careful: float  # m/s
    spin: float  # rad/s
    gain: float  # 1/s, from an error in heading to a turning rate
    facing: float  # rad, that a heading may be off


QUICK = Pace(0.8, 0.4, 0.8, 2.0, 0.03)
# For a machine that answers late: what is seen is old by the time that it is answered.
PATIENT = Pace(0.5, 0.25, 0.3, 0.7, 0.08)


@dataclass(frozen=True, slots=True)
class View:
    """What the driver knows at one moment."""

    odometry: Odometry
    safety: SafetyState
    pressed: bool  # the bumper
    refusal: str | None = None  # of the last button pressed in this step
    granted: bool = False  # likewise

    @property
    def causes(self) -> frozenset[str]:
        """Return the names of what holds the vehicle."""
        return frozenset(cause.name for cause in self.safety.causes)

    @property
    def standing(self) -> bool:
        """Whether the vehicle stands, by odometry."""
        return is_standing(self.odometry.linear, self.odometry.angular)


@dataclass(frozen=True, slots=True)
class Step:
    """One part of the lap."""

    name: str
    drive: Callable[[View, Odometry], Twist]  # now, and the pose in which the step began
    done: Callable[[View, Odometry], bool]
    press: Press | None = None
    latched: bool = False  # the step lives with a latch, because it is about one


@dataclass(frozen=True, slots=True)
class Ask:
    """What the driver does at one moment."""

    twist: Twist = STILL
    press: Press | None = None


@dataclass(slots=True)
class Lap:
    """Where in the lap the vehicle is; ``advance`` moves it on."""

    steps: tuple[Step, ...]
    index: int = 0
    began: Odometry | None = None
    times_ns: list[int] = field(default_factory=list)  # when each step began
    unplanned: list[str] = field(default_factory=list)  # latches that were not meant
    recovering: tuple[str, ...] = ()  # from these latches

    @property
    def step(self) -> Step | None:
        """Return the step under way; None at the end."""
        return self.steps[self.index] if self.index < len(self.steps) else None

    def advance(self, view: View, now_ns: int) -> Ask:
        """Take in what is known and return what to do."""
        if self.step is None:
            return Ask()
        if self.began is None:
            self.began = view.odometry
            self.times_ns.append(now_ns)
        if self.step.done(view, self.began):
            self.index += 1
            self.began = None
            return Ask()
        if view.safety.latched and not self.step.latched:
            return self._recover(view.safety.latched)
        self.recovering = ()
        if "neutral" in view.causes:
            return Ask(press=self.step.press)
        return Ask(self.step.drive(view, self.began), self.step.press)

    def seconds(self, now_ns: int) -> float:
        """Return how long the lap has taken so far."""
        return (now_ns - self.times_ns[0]) / NS_PER_S if self.times_ns else 0.0

    def _recover(self, latched: tuple[str, ...]) -> Ask:
        if self.recovering != latched:
            self.recovering = latched
            self.unplanned.append(", ".join(latched))
        return Ask(press="reset")


def lap(fast: bool, pace: Pace = QUICK) -> tuple[Step, ...]:
    """Return the steps; the fast one ends before the way home."""
    north = math.pi / 2
    first = (
        Step("wait for safety", still, lambda v, _: v.safety.verdict in ("run", "slow")),
        Step("drive off to the wall", ahead(pace, pace.cruise), blocked),
        Step("back off", ahead(pace, -pace.careful), went(0.45)),
        Step("turn left", turn(pace, north), faces(pace, north)),
        Step("drive on", ahead(pace, pace.cruise), lambda v, _: "contact" in v.safety.latched),
        Step("reset, refused", still, lambda v, _: v.refusal is not None, "reset", latched=True),
        Step("release", still, released, "release", latched=True),
        Step("reset", still, lambda v, _: not v.safety.latched, "reset", latched=True),
        Step("back off", ahead(pace, -pace.careful), went(0.6)),
    )
    if fast:
        return first
    return (
        *first,
        Step("turn home", toward(pace, 0.0), bears(pace)),
        Step("drive home", toward(pace, pace.cruise), home),
        Step("turn as at the start", turn(pace, 0.0), faces(pace, 0.0)),
    )


def still(_: View, __: Odometry) -> Twist:
    """Ask for zero."""
    return STILL


def ahead(pace: Pace, linear: float) -> Callable[[View, Odometry], Twist]:
    """Ask for straight motion, holding the heading in which the step began."""

    def drive(view: View, began: Odometry) -> Twist:
        off = wrap(began.heading - view.odometry.heading)
        return Twist(linear, clamp(pace.gain * off, 0.3))

    return drive


def turn(pace: Pace, heading: float) -> Callable[[View, Odometry], Twist]:
    """Ask for a turn on the spot to a heading (rad)."""

    def drive(view: View, _: Odometry) -> Twist:
        off = wrap(heading - view.odometry.heading)
        return Twist(0.0, clamp(pace.gain * off, pace.spin))

    return drive


def toward(pace: Pace, linear: float) -> Callable[[View, Odometry], Twist]:
    """Ask for motion toward home, slower when near."""

    def drive(view: View, _: Odometry) -> Twist:
        off = bearing(view.odometry)
        slower = 0.4 * pace.gain * distance(view.odometry, 0.0, 0.0)
        speed = min(linear, slower) if abs(off) < 0.5 else 0.0
        return Twist(speed, clamp(pace.gain * off, pace.spin))

    return drive


def blocked(view: View, began: Odometry) -> bool:
    """Tell whether safety has stopped the vehicle on its way short of an obstacle."""
    under_way = distance(view.odometry, began.x, began.y) > UNDER_WAY
    return under_way and "blocked" in view.causes and view.standing


def went(metres: float) -> Callable[[View, Odometry], bool]:
    """Tell when the vehicle is that far from where the step began."""
    return lambda view, began: distance(view.odometry, began.x, began.y) >= metres


def faces(pace: Pace, heading: float) -> Callable[[View, Odometry], bool]:
    """Tell when the vehicle stands in a heading (rad)."""

    def done(view: View, _: Odometry) -> bool:
        return abs(wrap(heading - view.odometry.heading)) < pace.facing and view.standing

    return done


def bears(pace: Pace) -> Callable[[View, Odometry], bool]:
    """Tell when the vehicle stands and looks home."""
    return lambda view, _: abs(bearing(view.odometry)) < pace.facing and view.standing


def home(view: View, _: Odometry) -> bool:
    """Tell when the vehicle is home."""
    return distance(view.odometry, 0.0, 0.0) < 0.1


def released(view: View, began: Odometry) -> bool:
    """Tell when the bumper is free and the vehicle has crept a little further, or may not."""
    crept = distance(view.odometry, began.x, began.y)
    return not view.pressed and (crept > 0.05 or view.refusal is not None)


def distance(pose: Odometry, x: float, y: float) -> float:
    """Return how far a point is, in metres."""
    return math.hypot(x - pose.x, y - pose.y)


def bearing(pose: Odometry) -> float:
    """Return where home is seen from the vehicle, in radians, counter-clockwise."""
    return wrap(math.atan2(-pose.y, -pose.x) - pose.heading)


def wrap(angle: float) -> float:
    """Return an angle within -pi..pi."""
    return math.remainder(angle, math.tau)
