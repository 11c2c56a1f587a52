"""Settings of the safety service; unsafe values need an explicit override."""

from functools import cache
from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec import Meta, Struct
from msgspec.structs import replace

from common import settings
from common.settings import SourceName

Seconds = Annotated[float, Meta(gt=0.0, le=10.0)]
Positive = Annotated[float, Meta(gt=0.0, le=10.0)]
Sources = Meta(max_length=16)  # of a kind: their names are parts of texts, see ``messages.Text``

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


class TimeLimits(Struct, frozen=True, kw_only=True):
    """Time limits in seconds: an older sample or request stops the vehicle."""

    bumper_age: float = 0.15  # 7 polls
    ultrasonic_age: float = 0.3  # 6 polls
    velocity_age: float = 0.2  # 10 reports
    link_age: float = 0.6  # 3 messages
    switches_age: float = 3.0  # 3 messages
    driver_age: float = 2.0  # 4 polls
    estop_path_age: float = 0.2  # of the own state, received back through the router
    max_echo_age: float = 0.4  # of a request to move, by the heartbeat that it echoes
    runaway_time: float = 0.3  # that the vehicle may move otherwise than commanded


@cache
def _times(stall_s: float) -> TimeLimits:
    return settings.lengthened(TimeLimits(), stall_s)


class Safety(settings.ProtectedSection, frozen=True, kw_only=True):
    """When and how fast the vehicle may move; SI units."""

    protective: ClassVar[settings.Limits] = {
        "margin": (0.05, 10.0),
        "stall": (0.0, 0.0),
        "react": (0.1, 10.0),
        "deceleration": (0.1, 1.0),
        "angular_deceleration": (0.1, 3.0),
        "max_linear": (0.0, 1.5),
        "max_angular": (0.0, 2.0),
        "linear_acceleration": (0.0, 1.5),
        "angular_acceleration": (0.0, 4.0),
        "release_speed": (0.0, 0.15),
        "release_distance": (0.0, 0.3),
        "creep_speed": (0.0, 0.25),
        "estop_keepalive_timeout": (0.0, 2.0),
        "require_switches": (True, True),
    }
    # s that processes of this computer stall: every time limit and ``react`` is longer
    stall: settings.Stall = 0.0
    # sources on @cmd/drive/NAME, lease in s; operator: a person holds it, and may creep past a
    # faulty sonar
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
    creep_speed: Positive = 0.15  # m/s while a sonar or the bumper is doubtful

    require_switches: bool = True  # requires the board's own emergency brakes

    release_speed: Positive = 0.1  # m/s
    release_distance: Positive = 0.15  # m in total until a reset

    @property
    def times(self) -> "TimeLimits":
        """The time limits on this computer."""
        return _times(self.stall)

    @property
    def reaction(self) -> float:
        """Time from a reading to slowing down, on this computer, s."""
        return self.react + 2 * self.stall

    @property
    def leased(self) -> dict[str, Source]:
        """The sources with their leases on this computer."""
        return {
            name: replace(source, lease=source.lease + 3 * self.stall)
            for name, source in self.sources.items()
        }

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
        names: dict[int, str] = {}  # by priority
        for name, source in self.sources.items():
            if (other := names.setdefault(source.priority, name)) != name:
                raise ValueError(
                    f"sources {other} and {name} have the same priority, {source.priority}"
                )


class SafetyConfig(settings.Shared, frozen=True, kw_only=True):
    """Sections that the safety service reads."""

    vehicle: settings.Vehicle = settings.Vehicle()
    safety: Safety = Safety()

    def __post_init__(self) -> None:
        # Space beyond ``sonar_max`` counts as free, so the vehicle must be able to stop within it.
        deepest = max(
            settings.recess(each, self.vehicle) for each in settings.sonar_mounts(self.vehicle)
        )
        one, range_m = self.safety, self.vehicle.sonar_max - deepest
        needed = (
            one.margin + one.reaction * one.max_linear + one.max_linear**2 / one.deceleration / 2
        )
        if range_m < needed:
            raise ValueError(
                f"sonar_max {range_m:g} m is too near: from max_linear {one.max_linear:g} m/s "
                f"the vehicle stops in {needed:.2f} m"
            )
