"""The safety service's settings; a value that takes a protection away must be owned up to."""

from typing import Annotated

import msgspec
from msgspec import Meta

from common import settings

Seconds = Annotated[float, Meta(gt=0.0, le=10.0)]
Positive = Annotated[float, Meta(gt=0.0, le=10.0)]

# Outside of these a protection is as good as gone. A setting there is refused unless
# ``unsafe_overrides`` names it. Zero never means "off".
PROTECTIVE: dict[str, tuple[float, float]] = {
    "margin": (0.05, 10.0),
    "react": (0.1, 10.0),
    "deceleration": (0.1, 1.0),
    "angular_deceleration": (0.1, 3.0),
    "max_linear": (0.0, 1.5),
    "max_angular": (0.0, 2.0),
    "linear_acceleration": (0.0, 1.5),
    "angular_acceleration": (0.0, 4.0),
    "bumper_age": (0.0, 0.25),
    "ultrasonic_age": (0.0, 0.5),
    "velocity_age": (0.0, 0.5),
    "link_age": (0.0, 1.5),
    "switches_age": (0.0, 5.0),
    "driver_age": (0.0, 5.0),
    "estop_path_age": (0.0, 0.5),
    "settle": (0.1, 10.0),
    "max_echo_age": (0.0, 1.0),
    "max_call_age": (0.0, 1.5),
    "runaway_linear": (0.0, 0.5),
    "runaway_angular": (0.0, 1.0),
    "runaway_time": (0.0, 1.0),
    "release_speed": (0.0, 0.15),
    "release_distance": (0.0, 0.3),
    "release_lease": (0.0, 0.5),
    "hysteresis": (0.02, 10.0),
    "stuck_travel": (0.0, 1.0),
    "creep_speed": (0.0, 0.25),
    "require_switches": (True, True),
}
# Our programs that stop requesting when a person lets go; ``sources.NAME.operator`` of any other is
# subject to the same rule.
HELD = ("teleop", "checkout", "web")
MAX_LEASE_S = 0.5  # longer leases are subject to the same rule, as ``sources.NAME.lease``


class Source(settings.Section, frozen=True, kw_only=True):
    """Who may ask to drive; the highest priority among those with a fresh request drives."""

    priority: Annotated[int, Meta(ge=0, le=1000)]
    lease: Seconds  # s that a request holds
    operator: bool = False  # a person drives with it, and may creep past a faulty sonar


def _sources() -> dict[str, Source]:
    return {
        "teleop": Source(priority=30, lease=0.3, operator=True),
        "checkout": Source(priority=25, lease=0.3, operator=True),
        "web": Source(priority=20, lease=0.3, operator=True),
        "demo": Source(priority=15, lease=0.3),
        "nav": Source(priority=10, lease=0.2),
    }


class Safety(settings.Section, frozen=True, kw_only=True):
    """When and how fast the vehicle may move; SI units."""

    unsafe_overrides: tuple[str, ...] = ()  # settings that take a protection away, on purpose
    sources: dict[str, Source] = msgspec.field(default_factory=_sources)

    max_linear: Positive = 1.0  # m/s
    max_angular: Positive = 1.0  # rad/s
    linear_acceleration: Positive = 0.5  # m/s^2
    angular_acceleration: Positive = 1.5  # rad/s^2
    deceleration: Positive = 0.6  # m/s^2 that the vehicle surely reaches when it slows down
    angular_deceleration: Positive = 1.0  # rad/s^2, likewise

    margin: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.20  # m that stay free
    react: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.25  # s from reading to slowing down
    hysteresis: Annotated[float, Meta(ge=0.01, le=0.5)] = 0.05  # m until a farther reading counts
    # m along a sonar's axis without a changed reading, until it is suspect
    stuck_travel: Annotated[float, Meta(ge=0.1, le=5.0)] = 0.5
    creep_speed: Positive = 0.15  # m/s while a sonar or the bumper is in doubt

    bumper_age: Seconds = 0.15
    ultrasonic_age: Seconds = 0.3
    velocity_age: Seconds = 0.2
    link_age: Seconds = 0.6
    switches_age: Seconds = 3.0
    driver_age: Seconds = 2.0
    estop_path_age: Seconds = 0.2  # of our own state, received through the router
    settle: Seconds = 0.5  # s that inputs must be good again
    max_echo_age: Seconds = 0.4  # s, of a request to move and of a held release
    max_call_age: Seconds = 1.0  # s, of a reset
    require_switches: bool = True  # the board's own emergency brakes must be on

    runaway_linear: Positive = 0.3  # m/s over the commanded speed
    runaway_angular: Positive = 0.5  # rad/s
    runaway_time: Seconds = 0.3

    release_speed: Positive = 0.1  # m/s
    release_distance: Positive = 0.15  # m in total until a reset
    release_lease: Seconds = 0.3

    @property
    def operators(self) -> frozenset[str]:
        """The sources that a person drives with."""
        return frozenset(name for name, source in self.sources.items() if source.operator)

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in PROTECTIVE}
        allowed = dict(PROTECTIVE)
        for name, source in self.sources.items():
            given[f"sources.{name}.lease"] = source.lease
            allowed[f"sources.{name}.lease"] = (0.0, MAX_LEASE_S)
            given[f"sources.{name}.operator"] = source.operator
            allowed[f"sources.{name}.operator"] = (False, name in HELD)
        settings.check_protections(given, allowed, self.unsafe_overrides)
        priorities = [source.priority for source in self.sources.values()]
        if len(set(priorities)) < len(priorities):
            raise ValueError(f"sources must have different priorities, not {sorted(priorities)}")


class SafetyConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the safety service reads."""

    vehicle: settings.Vehicle = settings.Vehicle()
    safety: Safety = Safety()

    def __post_init__(self) -> None:
        # What is farther than ``sonar_max`` counts as free: the vehicle must be able to stop in it.
        one, sight = self.safety, self.vehicle.sonar_max
        needed = one.margin + one.react * one.max_linear + one.max_linear**2 / one.deceleration / 2
        if sight < needed:
            raise ValueError(
                f"sonar_max {sight:g} m is too near: from max_linear {one.max_linear:g} m/s "
                f"the vehicle stops in {needed:.2f} m"
            )
