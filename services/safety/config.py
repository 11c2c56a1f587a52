"""Settings of the safety service."""

from functools import cache
from typing import Annotated

import msgspec
from msgspec import Meta, Struct
from msgspec.structs import replace

from common import settings
from common.settings import Safe, SourceName, allowed
from t2.messages import Silence

DECISION_PERIOD_S = 1 / 50  # a sample or request waits at most this long

Sources = Meta(max_length=16)  # of a kind: their names are parts of texts, see ``messages.Text``

# Programs that stop requesting when the operator lets go of the controls. For any other source,
# ``sources.NAME.operator`` needs an override.
HELD = ("teleop", "checkout", "web")


class Source(settings.Section, frozen=True, kw_only=True):
    """A source of drive requests; the fresh one of the highest priority is in control."""

    priority: Annotated[int, Meta(ge=0, le=1000)]
    lease: Annotated[float, allowed("s", gt=0.0, le=10.0, safe=(0.0, 0.5))]  # of a request
    # a person holds it, and may creep past a faulty sonar
    operator: Annotated[bool, allowed(safe=(False, False))] = False


class LimitSource(settings.Section, frozen=True, kw_only=True):
    """A source of speed limits; every field is required, because no default fits all."""

    lease: Annotated[float, allowed("s", gt=0.0, le=10.0, safe=(0.0, 1.0))]  # of a limit
    silence: Silence  # what the end of the lease does, and a start without any limit

    @property
    def latches(self) -> bool:
        """Whether it keeps an emergency stop alive, as a pendant does."""
        return self.silence == "latch"

    def protections(self) -> dict[str, Safe]:
        """Return the safe values; a sign of life proves more than a limit, and may come later."""
        return {"lease": Safe(0.0, 2.0, "s")} if self.latches else super().protections()


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

    bumper_age: float = 0.07  # 3 polls: a press of 60 ms is in one of them
    ultrasonic_age: float = 0.3  # 6 polls
    velocity_age: float = 0.2  # 10 reports
    link_age: float = 0.6  # 3 messages
    switches_age: float = 3.0  # 3 messages
    driver_age: float = 2.0  # 4 polls
    estop_path_age: float = 0.2  # of the own state, received back through the router
    max_echo_age: float = 0.4  # of a request to move, by the heartbeat that it echoes
    runaway_time: float = 0.3  # that the vehicle may move otherwise than commanded


class Safety(settings.Section, frozen=True, kw_only=True):
    """When and how fast the vehicle may move."""

    # sources on @cmd/drive/NAME, lease in s; operator: a person holds it, and may creep past a
    # faulty sonar
    sources: Annotated[dict[SourceName, Source], Sources] = msgspec.field(default_factory=_sources)
    # sources of speed limits on @cmd/limit/NAME, as lidar = { lease = 0.5, silence = "stop" }; an
    # emergency stop that must be kept alive is pendant = { lease = 1.0, silence = "latch" }
    limits: Annotated[dict[SourceName, LimitSource], Sources] = msgspec.field(default_factory=dict)

    linear_acceleration: Annotated[float, allowed("m/s^2", gt=0.0, le=10.0, safe=(0.0, 1.5))] = 0.5
    angular_acceleration: Annotated[float, allowed("rad/s^2", gt=0.0, le=10.0, safe=(0.0, 4.0))] = (
        1.5
    )
    # kept free around the vehicle
    margin: Annotated[float, allowed("m", ge=0.0, le=2.0, safe=(0.05, 2.0))] = 0.20
    # from reading to slowing down, without the wait for a decision
    react: Annotated[float, allowed("s", ge=0.0, le=2.0, safe=(0.1, 2.0))] = 0.25
    # while a sonar is doubtful
    creep_speed: Annotated[float, allowed("m/s", gt=0.0, le=10.0, safe=(0.0, 0.25))] = 0.15
    release_speed: Annotated[float, allowed("m/s", gt=0.0, le=10.0, safe=(0.0, 0.15))] = 0.1
    # in total until a reset
    release_distance: Annotated[float, allowed("m", gt=0.0, le=10.0, safe=(0.0, 0.3))] = 0.15

    def protections(self) -> dict[str, Safe]:
        """Return the safe values; a program of ours that an operator holds needs no override."""
        held = {f"sources.{name}.operator" for name in HELD}
        return {path: it for path, it in super().protections().items() if path not in held}

    @property
    def operators(self) -> frozenset[str]:
        """The sources that an operator holds."""
        return frozenset(name for name, source in self.sources.items() if source.operator)

    def __post_init__(self) -> None:
        for name in self.limits.keys() & self.sources.keys():
            if not self.limits[name].latches:  # a driver may only keep an emergency stop alive
                raise ValueError(
                    f"limits.{name} has the name of a source of motion, whose driver could lift "
                    "the limit: choose another name"
                )
        names: dict[int, str] = {}  # by priority
        for name, source in self.sources.items():
            if (other := names.setdefault(source.priority, name)) != name:
                raise ValueError(
                    f"sources {other} and {name} have the same priority, {source.priority}"
                )


class SafetyConfig(settings.Shared, frozen=True, kw_only=True):
    """Sections that the safety service reads."""

    board: settings.Board = settings.Board()
    vehicle: settings.Vehicle = settings.Vehicle()
    safety: Safety = Safety()

    @property
    def times(self) -> TimeLimits:
        """The time limits on this computer."""
        return _times(self.host.stall)

    @property
    def reaction(self) -> float:
        """Time from a reading to slowing down, on this computer, s."""
        return self.safety.react + DECISION_PERIOD_S + 2 * self.host.stall

    @property
    def leased(self) -> dict[str, Source]:
        """The sources with their leases on this computer."""
        return {
            name: replace(source, lease=source.lease + 3 * self.host.stall)
            for name, source in self.safety.sources.items()
        }

    def __post_init__(self) -> None:
        # Space beyond ``sonar_max`` counts as free, so the vehicle must be able to stop within it.
        body = self.vehicle
        deepest = max(settings.recess(each, body) for each in settings.sonar_mounts(body))
        fastest, range_m = body.max_linear, body.sonar_max - deepest
        needed = self.safety.margin + self.reaction * fastest + fastest**2 / body.deceleration / 2
        if range_m < needed:
            raise ValueError(
                f"sonar_max {range_m:g} m is too near: from max_linear {fastest:g} m/s "
                f"the vehicle stops in {needed:.2f} m"
            )


@cache
def _times(stall_s: float) -> TimeLimits:
    return settings.lengthened(TimeLimits(), stall_s)
