"""Motion planning: limits, zones and ramp turn a requested twist into the twist to command."""

import math
from collections.abc import Iterator

from msgspec import Struct

from common.messages import SONAR_NAMES
from common.motion import RUN, STILL, Twist, clamp
from common.settings import Vehicle
from services.safety.causes import wants_neutral
from services.safety.config import Safety
from services.safety.latches import Latches, Observation
from services.safety.release import sweep
from services.safety.state import State
from services.safety.zones import zones


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

    def __init__(self, settings: Safety, vehicle: Vehicle) -> None:
        self.zones = zones(vehicle, settings)
        self.reach = math.hypot(vehicle.length, vehicle.width) / 2  # m, to the body's corners
        self._settings = settings
        self.creep_room = self.zones.room(settings.creep_speed)
        self._up = Twist(settings.linear_acceleration, settings.angular_acceleration)
        self._down = Twist(settings.deceleration, settings.angular_deceleration)

    def requested(self, state: State, now_ns: int) -> RequestedTwist | None:
        """Return the motion that the source in control requests."""
        source = state.arbiter.in_control(now_ns)
        if source is None:
            return None
        is_release = state.release.direction is not None
        if is_release:
            twist = state.release.away(self._settings.release_speed)
        else:
            twist = self.limited(state.arbiter.channels[source].requested, state.latches)
        return RequestedTwist(source, *state.speed_limits.limited(twist, now_ns), is_release)

    def limited(self, asked: Twist, held: Latches) -> Twist:
        """Return the twist within the limits; at creep speed while bumper polls are lost."""
        twist = asked.within(self._settings.max_linear, self._settings.max_angular)
        if "bumper_lossy" not in held:
            return twist
        fastest = sweep(twist, self.reach)
        return twist.scaled(min(1.0, self._settings.creep_speed / fastest)) if fastest else twist

    def with_overrides(
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
        distances = self.with_overrides(state.sonar_array.cautious, state, source)
        limit = self.zones.limit(requested.twist, distances)
        target = requested.twist.scaled(limit.factor)
        sent = state.verdict
        current = sent.twist if sent.command is RUN else ramp_start(measured, target)
        ramped = ramp(current, target, self._up, self._down, step_s)
        here = self.zones.limit(ramped, distances)
        for tightest in (limit, here):
            if tightest.factor == 0:
                return Plan(blocked_by=tightest.sonar)
        shown = self.with_overrides(state.sonar_array.distances, state, source)
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
    state: State, requested: RequestedTwist | None, plan: Plan, now_ns: int
) -> Iterator[Observation]:
    """Yield the causes that depend on a request, present or not."""
    tick = (0, now_ns)
    faults = state.sonar_array.faults
    creeping = requested is not None and requested.is_release
    overruled = _overruled_text(state, requested)
    yield Observation("no_request", requested is None, tick)
    yield Observation("neutral", _neutral_is_due(state, requested), tick, overruled)
    yield Observation("release", creeping, tick)
    blocked, slowed = plan.blocked_by, plan.slowed_by
    yield Observation("blocked", blocked is not None, tick, _blocked_text(state, blocked, creeping))
    if state.speed_limits.sources:
        limited_by = requested.limited_by if requested else None
        slowed_text = state.speed_limits.slowed_text(limited_by)
        yield Observation("limit", limited_by is not None, tick, slowed_text)
    yield Observation("obstacle", slowed is not None, tick, _slowed_text(state, slowed))
    yield Observation("sonar", bool(faults), tick, f"Sonar not trusted: {faults}.")


def _neutral_is_due(state: State, requested: RequestedTwist | None) -> bool:
    """Return whether a neutral request is due; other causes must clear first."""
    if requested is None or requested.is_release:
        return False
    if any(wants_neutral(name) for name in state.latches):
        return False
    return not state.arbiter.channels[requested.source].neutral


def _overruled_text(state: State, requested: RequestedTwist | None) -> str:
    """Return a text when another source overruled the requesting one; otherwise empty."""
    channel = state.arbiter.channels.get(requested.source) if requested else None
    if requested is None or channel is None or not channel.overruled_by:
        return ""
    return (
        f"{channel.overruled_by} was in control: {requested.source} needs a neutral request first."
    )


def _blocked_text(state: State, sonar: int | None, creeping: bool) -> str:
    if sonar is None:
        return ""
    name, one = SONAR_NAMES[sonar].replace("_", " "), state.sonar_array.sonars[sonar]
    if sonar in state.sonar_array.unseen and not creeping:
        past = "An operator can creep past: release the controls, then drive."
        return f"No motion toward the {name}: that sonar is {one.fault}. {past}"
    if one.fault:
        return f"No motion toward the {name}: that sonar is {one.fault}."
    return f"No room toward the {name}: {one.distance:.2f} m."


def _slowed_text(state: State, sonar: int | None) -> str:
    if sonar is None:
        return ""
    name, one = SONAR_NAMES[sonar].replace("_", " "), state.sonar_array.sonars[sonar]
    if one.fault:
        return f"Creeping toward the {name}: that sonar is {one.fault} and sees nothing there."
    if one.suspect:
        return (
            f"Creeping toward the {name}: that sonar still shows {one.same:.2f} m although the "
            "vehicle moved."
        )
    return f"Slowed by an obstacle at {one.distance:.2f} m ({name})."
