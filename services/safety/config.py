"""Settings of the safety service; unsafe values need an explicit override."""

from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec import Meta

from common import settings
from common.members import SourceName

Seconds = Annotated[float, Meta(gt=0.0, le=10.0)]
Positive = Annotated[float, Meta(gt=0.0, le=10.0)]
Sources = Meta(max_length=16)  # of a kind: their names are parts of texts, see ``verdict.Text``

# Programs that stop requesting when the operator releases the controls. For any other source,
# ``sources.NAME.operator`` needs an override.
HELD = ("teleop", "checkout", "web")
MAX_LEASE_S = 0.5  # a longer ``sources.NAME.lease`` needs an override
MAX_LIMIT_LEASE_S = 1.0  # a longer ``limits.NAME.lease`` likewise


class Source(settings.Section, frozen=True, kw_only=True):
    """A source of drive requests; the fresh one of the highest priority is in control."""

    priority: Annotated[int, Meta(ge=0, le=1000)]
    lease: Seconds  # s that a request holds
    operator: bool = False  # a person holds it, and may creep past a faulty sonar


Silence = Literal["ignore", "stop"]


class LimitSource(settings.Section, frozen=True, kw_only=True):
    """A source of speed limits; every field is required, because no default fits all."""

    lease: Seconds  # s that a limit holds
    silence: Silence  # what the end of the lease does, and a start without any limit


def _sources() -> dict[str, Source]:
    return {
        "teleop": Source(priority=30, lease=0.3, operator=True),
        "checkout": Source(priority=25, lease=0.3, operator=True),
        "web": Source(priority=20, lease=0.3, operator=True),
        "demo": Source(priority=15, lease=0.3),
        "ros2": Source(priority=11, lease=0.3),
        "nav": Source(priority=10, lease=0.2),
    }


class Safety(settings.ProtectedSection, frozen=True, kw_only=True):
    """When and how fast the vehicle may move; SI units."""

    protective: ClassVar[settings.Limits] = {
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
        "hysteresis": (0.02, 10.0),
        "stuck_travel": (0.0, 1.0),
        "creep_speed": (0.0, 0.25),
        "estop_keepalive_timeout": (0.0, 2.0),
        "require_switches": (True, True),
    }
    # sources on @cmd/drive/NAME; operator: a person holds it, and may creep past a faulty sonar
    sources: Annotated[dict[SourceName, Source], Sources] = msgspec.field(default_factory=_sources)
    # names that must be received on @cmd/estop_keepalive/NAME, or the robot brakes and latches
    estop_keepalive: Annotated[tuple[SourceName, ...], Sources] = ()
    estop_keepalive_timeout: Seconds = 1.0  # s without one of them
    # sources of speed limits on @cmd/limit/NAME, as lidar = { lease = 0.5, silence = "stop" }
    limits: Annotated[dict[SourceName, LimitSource], Sources] = msgspec.field(default_factory=dict)

    max_linear: Positive = 1.0  # m/s
    max_angular: Positive = 1.0  # rad/s
    linear_acceleration: Positive = 0.5  # m/s^2
    angular_acceleration: Positive = 1.5  # rad/s^2
    deceleration: Positive = 0.6  # m/s^2, guaranteed when slowing down
    angular_deceleration: Positive = 1.0  # rad/s^2, likewise

    margin: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.20  # m kept free around the vehicle
    react: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.25  # s from reading to slowing down
    # m; a farther reading counts beyond this
    hysteresis: Annotated[float, Meta(ge=0.01, le=0.5)] = 0.05
    # m along a sonar's axis with a constant reading, until the sonar is suspect
    stuck_travel: Annotated[float, Meta(ge=0.1, le=5.0)] = 0.5
    creep_speed: Positive = 0.15  # m/s while a sonar or the bumper is doubtful

    bumper_age: Seconds = 0.15  # s; an older sample stops the vehicle
    ultrasonic_age: Seconds = 0.3  # s
    velocity_age: Seconds = 0.2  # s
    link_age: Seconds = 0.6  # s
    switches_age: Seconds = 3.0  # s
    driver_age: Seconds = 2.0  # s
    estop_path_age: Seconds = 0.2  # s, of the own state, received back through the router
    settle: Seconds = 0.5  # s of good inputs until a cause clears
    max_echo_age: Seconds = 0.4  # s, of a request to move
    max_call_age: Seconds = 1.0  # s, of a reset
    require_switches: bool = True  # requires the board's own emergency brakes

    runaway_linear: Positive = 0.3  # m/s over the commanded speed
    runaway_angular: Positive = 0.5  # rad/s
    runaway_time: Seconds = 0.3  # s

    release_speed: Positive = 0.1  # m/s
    release_distance: Positive = 0.15  # m in total until a reset

    @property
    def operators(self) -> frozenset[str]:
        """The sources that an operator holds."""
        return frozenset(name for name, source in self.sources.items() if source.operator)

    def __post_init__(self) -> None:
        allowed = dict(self.protective)
        given = {name: getattr(self, name) for name in allowed}
        for name, source in self.sources.items():
            given[f"sources.{name}.lease"] = source.lease
            allowed[f"sources.{name}.lease"] = (0.0, MAX_LEASE_S)
            given[f"sources.{name}.operator"] = source.operator
            allowed[f"sources.{name}.operator"] = (False, name in HELD)
        for name, limits in self.limits.items():
            given[f"limits.{name}.lease"] = limits.lease
            allowed[f"limits.{name}.lease"] = (0.0, MAX_LIMIT_LEASE_S)
        self.check(allowed, given)
        if len(set(self.estop_keepalive)) < len(self.estop_keepalive):
            raise ValueError(f"estop_keepalive names a source twice: {self.estop_keepalive}")
        priorities = [source.priority for source in self.sources.values()]
        if len(set(priorities)) < len(priorities):
            raise ValueError(f"sources must have different priorities, not {sorted(priorities)}")


class SafetyConfig(settings.Shared, frozen=True, kw_only=True):
    """Sections that the safety service reads."""

    vehicle: settings.Vehicle = settings.Vehicle()
    safety: Safety = Safety()

    def __post_init__(self) -> None:
        # Space beyond ``sonar_max`` counts as free, so the vehicle must be able to stop within it.
        one, range_m = self.safety, self.vehicle.sonar_max
        needed = one.margin + one.react * one.max_linear + one.max_linear**2 / one.deceleration / 2
        if range_m < needed:
            raise ValueError(
                f"sonar_max {range_m:g} m is too near: from max_linear {one.max_linear:g} m/s "
                f"the vehicle stops in {needed:.2f} m"
            )
