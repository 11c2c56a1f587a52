"""Settings of the bridge."""

from functools import cache
from typing import Annotated, ClassVar

from msgspec import Meta, Struct

from common import settings

Positive = Annotated[float, Meta(gt=0.0, le=10.0)]


class TimeLimits(Struct, frozen=True, kw_only=True):
    """Time limits in seconds."""

    lease: float = 0.2  # that a motion message is valid
    silence: float = 0.2  # without a frame: the link is lost
    failover: float = 0.1  # until the other port takes over; under ``silence``
    heartbeat: float = 0.2  # without a heartbeat of the bridge until the guard brakes
    coast: float = 1.0  # of STOP at most until BRAKE
    answer: float = 0.1  # for a query's answer
    echo: float = 0.5  # for the echo of a brake's switch or of a lamp


@cache
def _times(stall_s: float) -> TimeLimits:
    return settings.lengthened(TimeLimits(), stall_s)


class Bridge(settings.ProtectedSection, frozen=True, kw_only=True):
    """Parameters of the bridge."""

    protective: ClassVar[settings.Limits] = {
        "stall": (0.0, 0.0),
        "deceleration": (0.1, 10.0),
        "angular_deceleration": (0.1, 10.0),
        "max_linear": (0.0, 1.5),
        "max_angular": (0.0, 2.0),
        "require_switches": (True, True),
    }
    # s that processes of this computer stall: every time limit is longer
    stall: settings.Stall = 0.0
    deceleration: Positive = 0.6  # m/s^2 that a STOP must reach, or it becomes BRAKE sooner
    angular_deceleration: Positive = 1.0  # rad/s^2, likewise
    max_linear: Annotated[float, Meta(ge=0.05, le=3.0)] = 1.0  # m/s
    max_angular: Annotated[float, Meta(ge=0.05, le=3.0)] = 1.0  # rad/s
    require_switches: bool = True  # the board must echo that its emergency brakes are on

    @property
    def times(self) -> "TimeLimits":
        """The time limits on this computer."""
        return _times(self.stall)


class BridgeConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the bridge reads."""

    board: settings.Board = settings.Board()
    wire: settings.Wire = settings.Wire()
    vehicle: settings.Vehicle = settings.Vehicle()
    bridge: Bridge = Bridge()
