"""Creeping off a pressed bumper, held by an operator; never by itself.

One bumper bit has no direction, so the only way known to be free is the one it came by: the last
measured motion before the press, reversed. The fastest point of the body does at most the release
speed, and the way is counted by the larger of commanded and measured speed, so that slipping
wheels end it too. A press ends when the bumper was clear for three samples; only a new press has
its way anew.
"""

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import S
from services.safety.twist import STILL, Twist


class Release(Struct, frozen=True):
    """The press that is on, and how far it was crept off."""

    before: Twist | None = None  # the last measured motion before the press
    travelled: float = 0.0  # m
    held_ns: int | None = None  # when the operator last asked; None when let go

    def is_held(self, now_ns: int, lease_s: float) -> bool:
        """Tell whether the operator still holds."""
        return self.held_ns is not None and now_ns - self.held_ns <= lease_s * S

    def left(self, distance: float) -> float:
        """Return how many metres may still be crept, of ``distance`` for each press."""
        return max(0.0, distance - self.travelled)

    def away(self, speed: float, reach: float) -> Twist:
        """Return the motion back: no point within ``reach`` metres exceeds ``speed`` m/s."""
        if self.before is None:
            return STILL
        return self.before.scaled(-speed / sweep(self.before, reach))

    def crept(self, commanded: Twist, measured: Twist, reach: float, dt_s: float) -> "Release":
        """Return it ``dt_s`` seconds of creeping later."""
        speed = max(sweep(commanded, reach), sweep(measured, reach))
        return replace(self, travelled=self.travelled + speed * dt_s)


def sweep(twist: Twist, reach: float) -> float:
    """Return a bound on the speed (m/s) of any point within ``reach`` metres of the middle."""
    return abs(twist.linear) + abs(twist.angular) * reach
