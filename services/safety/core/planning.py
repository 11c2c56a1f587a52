"""Planning: limits, zones and ramp turn a requested twist into the twist to command.

Toward a reading d a twist may have the speed whose reaction and stopping distance fits:

    (v + w) * t_react + max((v + w) * max(t_v, t_w), v * t_v + w * t_w) / 2 = d - margin

``Axis`` gives v and w, the speeds (m/s) at which driving and turning approach what a sonar sees;
t_v and t_w are the stopping times of both. A vehicle in a curve slows down on both axes together,
in the longer time, or on each one by itself: then the one that retreats may end first. A twist that
is too fast for one sonar is scaled as a whole, which keeps its curve. A sonar without approach sets
no limit, so motion away from an obstacle stays possible.
"""

import math
from collections.abc import Iterator, Sequence

from msgspec import Struct

from common.motion import RUN, STILL, Twist, clamp
from services.safety.config import SafetyConfig
from services.safety.core.causes import BARRING, Observation
from services.safety.core.release import stopping_distance
from services.safety.core.sonars import Axis, axes
from services.safety.core.state import State
from t2.messages import CauseName

GRAZING = 1e-6  # m/s, m; below this is rounding: cos(90 deg) is not exactly 0
MEASURED_EXCESS_MPS = 0.2  # tolerance over the allowed speed, for lag and noise
MEASURED_CREEP_MPS = 0.05  # inside the margin


class SonarLimit(Struct, frozen=True):
    """Tightest limit on a twist, and the sonar that sets it (None without a limit)."""

    factor: float  # 0..1, to scale the twist by
    sonar: int | None = None


class Zones(Struct, frozen=True):
    """Zones of one vehicle; distances are in the manual's order of sonars."""

    axes: tuple[Axis, ...]
    arm: float  # m, the longest lever at which turning approaches what a sonar sees
    margin: float  # m
    react: float  # s
    deceleration: float  # m/s^2
    angular_deceleration: float  # rad/s^2

    def room(self, speed: float) -> float:
        """Return the distance (m) at which this speed is allowed straight toward an obstacle."""
        return self.margin + stopping_distance(speed, self.react, self.deceleration)

    def limit(self, twist: Twist, distances: Sequence[float]) -> SonarLimit:
        """Return the limit on a twist; a factor of 0 means blocked."""
        tightest = SonarLimit(1.0)
        for sonar, speed, way in self._approached(twist, distances):
            factor = self._factor(speed, way, distances[sonar])
            if factor < tightest.factor:
                tightest = SonarLimit(factor, sonar)
        return tightest

    def too_fast(self, measured: Twist, distances: Sequence[float]) -> int | None:
        """Return the sonar toward which the measured speed is too high, if any."""
        for sonar, speed, way in self._approached(measured, distances):
            if speed <= MEASURED_CREEP_MPS:
                continue
            allowed = speed * self._factor(speed, way, distances[sonar])
            if not allowed or speed > allowed + MEASURED_EXCESS_MPS:
                return sonar
        return None

    def _approached(
        self, twist: Twist, distances: Sequence[float]
    ) -> Iterator[tuple[int, float, float]]:
        """Yield each sonar that a twist approaches, unless it sees farther than any stop needs.

        With the speed of approach (m/s), and the way of stopping (m) toward the sonar's sector.
        """
        linear, angular = abs(twist.linear), abs(twist.angular) * self.arm
        linear_s = linear / self.deceleration
        angular_s = abs(twist.angular) / self.angular_deceleration
        longer_s = max(linear_s, angular_s)
        needed = self.margin + (linear + angular) * (self.react + longer_s / 2)
        for sonar, axis in enumerate(self.axes):
            if distances[sonar] >= needed:
                continue
            driving, turning = axis.approach(twist)
            speed = driving + turning
            apart = driving * linear_s + turning * angular_s
            way = max(speed * longer_s, apart) / 2
            if speed > GRAZING or way > GRAZING:
                yield sonar, max(0.0, speed), way

    def _factor(self, speed: float, way: float, distance: float) -> float:
        """Return the factor for a twist to stop before the margin; above 1 it may go faster.

        With the factor the speed shrinks, and the way of stopping with its square:
        f * speed * react + f^2 * way is the room.
        """
        room = distance - self.margin
        if room <= 0.0:
            return 0.0
        reacting = speed * self.react
        return 2 * room / (reacting + math.sqrt(reacting * reacting + 4 * way * room))


def zones(settings: SafetyConfig) -> Zones:
    """Return the zones of the vehicle with these settings."""
    mounted = axes(settings.vehicle)
    return Zones(
        mounted,
        max(max(abs(axis.angular), axis.swing) for axis in mounted),
        settings.safety.margin,
        settings.reaction,
        settings.vehicle.deceleration,
        settings.vehicle.angular_deceleration,
    )


class RequestedTwist(Struct, frozen=True):
    """A source and its requested motion, within the limits."""

    source: str
    twist: Twist
    limited_by: str | None = None  # the limit source that slows it
    is_release: bool = False  # whether it moves off a pressed bumper


class Plan(Struct, frozen=True):
    """The planned twist, and what limits it."""

    twist: Twist = STILL
    slowed_by: int | None = None  # the sonar that limits the requested twist
    blocked_by: int | None = None  # the sonar without room for any motion


class Planner:
    """Plans twists for one vehicle; holds no state."""

    def __init__(self, settings: SafetyConfig) -> None:
        body, own = settings.vehicle, settings.safety
        self.zones = zones(settings)
        self.reach = math.hypot(body.length, body.width) / 2  # m, to the body's corners
        self._vehicle, self._settings = body, own
        self.creep_room = self.zones.room(own.creep_speed)
        self._up = Twist(own.linear_acceleration, own.angular_acceleration)
        self._down = Twist(body.deceleration, body.angular_deceleration)

    def requested(self, state: State, now_ns: int) -> RequestedTwist | None:
        """Return the motion that the source in control requests."""
        source = state.arbiter.in_control(now_ns)
        if source is None:
            return None
        is_release = state.release.direction is not None
        if is_release:
            twist = state.release.away(self._settings.release_speed)
        else:
            twist = self.limited(state.arbiter.channels[source].requested)
        return RequestedTwist(source, *state.speed_limits.limited(twist, now_ns), is_release)

    def limited(self, asked: Twist) -> Twist:
        """Return the twist within the vehicle's limits."""
        return asked.within(self._vehicle.max_linear, self._vehicle.max_angular)

    def cautious(self, state: State, source: str | None) -> tuple[float, ...]:
        """Return the distances that a source plans with."""
        return self._with_overrides(state.sonar_array.cautious, state, source)

    def _with_overrides(
        self, distances: tuple[float, ...], state: State, source: str | None
    ) -> tuple[float, ...]:
        """Return the distances, with creep room toward faulty sonars that the source overrides."""
        overridden = state.overrides.acknowledged_by(source)
        if not overridden:
            return distances
        return tuple(
            self.creep_room if n in overridden else distance for n, distance in enumerate(distances)
        )

    def plan(self, state: State, measured: Twist, requested: RequestedTwist, step_s: float) -> Plan:
        """Return the twist for the next step; zero when the way is blocked."""
        source = None if requested.is_release else requested.source  # it overrides no sonar
        distances = self.cautious(state, source)
        limit = self.zones.limit(requested.twist, distances)
        target = requested.twist.scaled(limit.factor)
        sent = state.verdict
        current = sent.twist if sent.command is RUN else ramp_start(measured, target)
        ramped = ramp(current, target, self._up, self._down, step_s)
        # On the ramp the curve is another one.
        here = SonarLimit(1.0) if ramped == target else self.zones.limit(ramped, distances)
        for tightest in (limit, here):
            if tightest.factor == 0:
                return Plan(blocked_by=tightest.sonar)
        shown = self._with_overrides(state.sonar_array.distances, state, source)
        blocked_by = self.zones.too_fast(measured, shown)
        if blocked_by is not None:
            return Plan(blocked_by=blocked_by)
        return Plan(ramped.scaled(here.factor), limit.sonar)


def ramp(current: Twist, target: Twist, up: Twist, down: Twist, dt_s: float) -> Twist:
    """Return the velocity after ``dt_s`` seconds on the ramp from current to target.

    ``up`` limits growing and ``down`` shrinking magnitudes, in m/s^2 and rad/s^2. Only requests
    are ramped: a stop of safety takes effect at once.
    """
    return Twist(
        _step(current.linear, target.linear, up.linear * dt_s, down.linear * dt_s),
        _step(current.angular, target.angular, up.angular * dt_s, down.angular * dt_s),
    )


def _step(current: float, target: float, up: float, down: float) -> float:
    """Return one component after a step; a change of direction stops at zero first."""
    if current * target < 0:
        target = 0.0
    return current + clamp(target - current, up if abs(target) > abs(current) else down)


def ramp_start(measured: Twist, target: Twist) -> Twist:
    """Return the start of a ramp after a stop: the remaining motion toward the target."""
    return Twist(
        _overlap(measured.linear, target.linear), _overlap(measured.angular, target.angular)
    )


def _overlap(measured: float, target: float) -> float:
    if measured * target <= 0:
        return 0.0
    return measured if abs(measured) < abs(target) else target


def observations(
    state: State, requested: RequestedTwist | None, plan: Plan
) -> Iterator[Observation]:
    """Yield the causes that a request shows."""
    shown: dict[CauseName, bool] = {
        "no_request": requested is None,
        "neutral": _neutral_is_due(state, requested),
        "release": requested is not None and requested.is_release,
        "blocked": plan.blocked_by is not None,
        "limit": requested is not None and requested.limited_by is not None,
        "obstacle": plan.slowed_by is not None,
        "sonar": state.sonar_array.is_doubted,
    }
    for name, is_shown in shown.items():
        if is_shown:
            yield Observation(name)


def _neutral_is_due(state: State, requested: RequestedTwist | None) -> bool:
    """Return whether a neutral request is due; other causes must clear first."""
    if requested is None or requested.is_release:
        return False
    if not BARRING.isdisjoint(state.latches):
        return False
    return not state.arbiter.is_neutral(requested.source)
