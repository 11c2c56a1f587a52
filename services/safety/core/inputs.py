"""Inputs of a decision: the newest sample of each stream, and what operators ask for."""

from typing import Generic, TypeVar

from msgspec import Struct

from common.freshness import Latest, fresh
from common.motion import Twist
from t2.messages import (
    Bumper,
    Drive,
    Driver,
    Limit,
    Link,
    Mileage,
    ResetRequest,
    SafetyState,
    SourceMessage,
    Switches,
    Ultrasonic,
    Velocity,
)

M = TypeVar("M", bound=SourceMessage)


class Request(Struct, Generic[M], frozen=True):
    """A message of a source; ``message`` is None for an invalid payload."""

    source: str
    message: M | None
    received_ns: int = 0


class DriveRequest(Request[Drive], frozen=True):
    """A drive request."""


class LimitRequest(Request[Limit], frozen=True):
    """A speed limit, or a sign of life of an emergency stop."""


SourceRequest = DriveRequest | LimitRequest


class Inputs(Struct, frozen=True):
    """A snapshot; a stream is None until its first sample."""

    velocity: Latest[Velocity] | None = None
    mileage: Latest[Mileage] | None = None
    ultrasonic: Latest[Ultrasonic] | None = None
    bumper: Latest[Bumper] | None = None
    left: Latest[Driver] | None = None
    right: Latest[Driver] | None = None
    switches: Latest[Switches] | None = None
    link: Latest[Link] | None = None
    estop_connection: int = 0  # number of its own session's connection to a router; 0 without one
    # This service's own state, received back through the router on that session.
    estop_path: Latest[SafetyState] | None = None
    leaving: bool = False  # whether this service is shutting down
    estop: bool = False  # a PUT or DELETE on the estop key since the last decision
    reset: ResetRequest | None = None
    boot: int = 0  # this service's own

    def known_velocity(self, now_ns: int, age_s: float) -> Latest[Twist] | None:
        """Return the measured velocity; None when older than ``age_s``."""
        return self.measured if fresh(self.velocity, now_ns, age_s) else None

    @property
    def is_pressed(self) -> bool:
        """Whether the newest bumper sample is a pressed one."""
        return self.bumper is not None and self.bumper.value.pressed

    @property
    def measured(self) -> Latest[Twist] | None:
        """The newest measured velocity of any age."""
        if self.velocity is None:
            return None
        velocity = self.velocity.value
        return Latest(Twist(velocity.linear, velocity.angular), self.velocity.received_ns)
