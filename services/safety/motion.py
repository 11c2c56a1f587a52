"""From a wish to a twist: limits, zones, ramp, and what of that the operator should know."""

import math
from collections.abc import Iterator

from msgspec import Struct

from common.messages import SONAR_NAMES
from common.motion import RUN, STILL, Twist
from common.settings import Vehicle
from services.safety.causes import wants_neutral
from services.safety.config import Safety
from services.safety.latches import Latches, Observation
from services.safety.ramp import ramp, start
from services.safety.release import sweep
from services.safety.state import RELEASE, State
from services.safety.zones import zones


class Wish(Struct, frozen=True):
    """Who asks for which motion, within the limits."""

    source: str
    twist: Twist


class Plan(Struct, frozen=True):
    """What the wish comes down to."""

    twist: Twist = STILL
    slowed_by: int | None = None  # the sonar that limits the wish
    blocked_by: int | None = None  # the sonar that leaves no room


class Planner:
    """Turns wishes into twists; holds no state."""

    def __init__(self, settings: Safety, vehicle: Vehicle) -> None:
        self.zones = zones(vehicle, settings)
        self.reach = math.hypot(vehicle.length, vehicle.width) / 2  # m, to the body's corners
        self._settings = settings
        self.creep_room = self.zones.room(settings.creep_speed)
        self._up = Twist(settings.linear_acceleration, settings.angular_acceleration)
        self._down = Twist(settings.deceleration, settings.angular_deceleration)

    def wish(self, state: State, creeping: bool, now_ns: int) -> Wish | None:
        """Return the motion that is asked for: the held release before any source."""
        settings = self._settings
        if creeping:
            return Wish(RELEASE, state.release.away(settings.release_speed))
        source = state.arbiter.driver(now_ns)
        if source is None:
            return None
        asked = state.arbiter.channels[source].wish
        return Wish(source, self.bounded(asked, state.latches))

    def bounded(self, asked: Twist, held: Latches) -> Twist:
        """Return the twist within the limits; at the creep speed while bumper polls are lost."""
        twist = asked.within(self._settings.max_linear, self._settings.max_angular)
        if "bumper_lossy" not in held:
            return twist
        fastest = sweep(twist, self.reach)
        return twist.scaled(min(1.0, self._settings.creep_speed / fastest)) if fastest else twist

    def past(
        self, distances: tuple[float, ...], state: State, source: str | None
    ) -> tuple[float, ...]:
        """Return the distances, with room for the creep where its operator acknowledged a fault."""
        known = state.blind.known_to(source)
        if not known:
            return distances
        return tuple(
            self.creep_room if n in known else distance for n, distance in enumerate(distances)
        )

    def plan(self, state: State, measured: Twist, wish: Wish, step_s: float) -> Plan:
        """Return the twist for the next moment; still when the way is blocked."""
        distances = self.past(state.heard.cautious, state, wish.source)
        limit = self.zones.limit(wish.twist, distances)
        target = wish.twist.scaled(limit.factor)
        sent = state.verdict
        current = sent.twist if sent.command is RUN else start(measured, target)
        ramped = ramp(current, target, self._up, self._down, step_s)
        here = self.zones.limit(ramped, distances)
        for tightest in (limit, here):
            if tightest.factor == 0:
                return Plan(blocked_by=tightest.sonar)
        shown = self.past(state.heard.distances, state, wish.source)
        blocked_by = self.zones.too_fast(measured, shown)
        if blocked_by is not None:
            return Plan(blocked_by=blocked_by)
        return Plan(ramped.scaled(here.factor), limit.sonar)


def observations(state: State, wish: Wish | None, plan: Plan, now_ns: int) -> Iterator[Observation]:
    """Yield the causes that depend on a wish, present or not."""
    tick = (0, now_ns)
    faults = state.heard.faults
    creeping = wish is not None and wish.source == RELEASE
    yield Observation("no_request", wish is None, tick)
    yield Observation("neutral", _wants_neutral(state, wish), tick, _overruled(state, wish))
    yield Observation("release", creeping, tick)
    blocked, slowed = plan.blocked_by, plan.slowed_by
    yield Observation("blocked", blocked is not None, tick, _blocked(state, blocked, creeping))
    yield Observation("obstacle", slowed is not None, tick, _slowed(state, slowed))
    yield Observation("sonar", bool(faults), tick, f"Sonar not trusted: {faults}.")


def _wants_neutral(state: State, wish: Wish | None) -> bool:
    """Tell whether the driver has yet to let go; other causes are to be cured first."""
    if wish is None or wish.source == RELEASE or any(wants_neutral(n) for n in state.latches):
        return False
    return not state.arbiter.channels[wish.source].neutral


def _overruled(state: State, wish: Wish | None) -> str:
    """Return which source overruled the requesting one; empty when none did."""
    channel = state.arbiter.channels.get(wish.source) if wish else None
    if wish is None or channel is None or not channel.overruled_by:
        return ""
    return f"{channel.overruled_by} has driven: {wish.source} needs a neutral request first."


def _blocked(state: State, sonar: int | None, creeping: bool) -> str:
    if sonar is None:
        return ""
    name, one = SONAR_NAMES[sonar].replace("_", " "), state.heard.sonars[sonar]
    if sonar in state.heard.unseen and not creeping:
        past = "An operator can creep past: release the controls, then drive."
        return f"No motion toward the {name}: that sonar is {one.fault}. {past}"
    if one.fault:
        return f"No motion toward the {name}: that sonar is {one.fault}."
    return f"No room toward the {name}: {one.distance:.2f} m."


def _slowed(state: State, sonar: int | None) -> str:
    if sonar is None:
        return ""
    name, one = SONAR_NAMES[sonar].replace("_", " "), state.heard.sonars[sonar]
    if one.fault:
        return f"Creeping toward the {name}: that sonar is {one.fault}, nothing is seen there."
    if one.suspect:
        return (
            f"Creeping toward the {name}: that sonar shows {one.same:.2f} m, whatever the vehicle "
            "does."
        )
    return f"Slowed by an obstacle at {one.distance:.2f} m ({name})."
