"""Settings of the bridge."""

from functools import cache

from msgspec import Struct

from common import settings


class TimeLimits(Struct, frozen=True, kw_only=True):
    """Time limits in seconds."""

    lease: float = 0.2  # that a motion message is valid
    silence: float = 0.2  # without a frame: the link is lost
    failover: float = 0.1  # until the other port takes over; under ``silence``
    pulse: float = 0.2  # without a pulse of the bridge until the guard brakes
    coast: float = 1.0  # of STOP at most until BRAKE
    answer: float = 0.1  # for a query's answer
    confirmation: float = 0.5  # of the board: for a brake's switch or a lamp


class BridgeConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the bridge reads."""

    board: settings.Board = settings.Board()
    wire: settings.Wire = settings.Wire()
    vehicle: settings.Vehicle = settings.Vehicle()

    @property
    def times(self) -> TimeLimits:
        """The time limits on this computer."""
        return _times(self.host.stall)


@cache
def _times(stall_s: float) -> TimeLimits:
    return settings.lengthened(TimeLimits(), stall_s)
