"""Zones: speed limits from the sonar distances.

Toward a reading d the vehicle may move at the v whose reaction and stopping distance fits:

    v * t_react + v^2 / (2 a) = d - margin

A sonar sits at (x, y) and looks along its yaw. Under a twist (v, w) that point moves with
(v - w*y, w*x); the component along the axis is the speed of approach. The sonars on the flanks
move across their axis, but the corners swing out to both sides when the vehicle turns. So these
sonars also limit |w| * length / 2. A twist that is too fast for one sonar is scaled as a whole,
which keeps its curve. A sonar without approach sets no limit, so motion away from an obstacle stays
possible.
"""

import math
from collections.abc import Sequence

from msgspec import Struct

from common.motion import Twist
from common.settings import Mount, Vehicle, sonar_mounts
from services.safety.config import Safety

GRAZING_MPS = 1e-6  # below this is rounding: cos(90 deg) is not exactly 0
MEASURED_EXCESS_MPS = 0.2  # tolerance over the allowed speed, for lag and noise
MEASURED_CREEP_MPS = 0.05  # inside the margin


class Limit(Struct, frozen=True):
    """Tightest limit on a twist, and the sonar that sets it (None without a limit)."""

    factor: float  # 0..1, to scale the twist by
    sonar: int | None = None


class Axis(Struct, frozen=True):
    """Speed of approach along a sonar's axis (m/s), for each m/s and each rad/s of a twist."""

    linear: float
    angular: float
    swing: float = 0.0  # m from the middle to the corner that swings out to its side; 0 without one


class Zones(Struct, frozen=True):
    """Zones of one vehicle; distances are in the manual's order of sonars."""

    axes: tuple[Axis, ...]
    margin: float  # m
    react: float  # s
    deceleration: float  # m/s^2

    def allowed(self, distance: float) -> float:
        """Return the speed (m/s) at which the vehicle can stop before the margin."""
        room = max(0.0, distance - self.margin)
        lag = self.deceleration * self.react
        return math.sqrt(lag * lag + 2 * self.deceleration * room) - lag

    def room(self, speed: float) -> float:
        """Return the distance (m) at which this speed is allowed."""
        return self.margin + stopping_distance(speed, self.react, self.deceleration)

    def along(self, sonar: int, twist: Twist) -> float:
        """Return the speed (m/s) of this sonar along its axis."""
        axis = self.axes[sonar]
        return twist.linear * axis.linear + twist.angular * axis.angular

    def approach(self, sonar: int, twist: Twist) -> float:
        """Return the speed (m/s) of approach to what this sonar sees."""
        along, swing = self.along(sonar, twist), self.axes[sonar].swing
        return max(along, abs(twist.angular) * swing) if swing else along

    def limit(self, twist: Twist, distances: Sequence[float]) -> Limit:
        """Return the limit on a twist; a factor of 0 means blocked."""
        tightest = Limit(1.0)
        for sonar, distance in enumerate(distances):
            speed = self.approach(sonar, twist)
            if speed <= GRAZING_MPS:
                continue
            factor = self.allowed(distance) / speed
            if factor < tightest.factor:
                tightest = Limit(factor, sonar)
        return tightest

    def too_fast(self, measured: Twist, distances: Sequence[float]) -> int | None:
        """Return the sonar toward which the measured speed is too high, if any."""
        for sonar, distance in enumerate(distances):
            allowed = self.allowed(distance)
            bound = allowed + MEASURED_EXCESS_MPS if allowed else MEASURED_CREEP_MPS
            if self.approach(sonar, measured) > bound:
                return sonar
        return None


def stopping_distance(speed: float, react: float, deceleration: float) -> float:
    """Return the distance (m) from the command to standstill that safety reckons with."""
    return speed * react + speed * speed / (2 * deceleration)


def zones(vehicle: Vehicle, settings: Safety) -> Zones:
    """Return the zones of this vehicle with these settings."""
    corner = vehicle.length / 2
    return Zones(
        axes=tuple(_axis(mount, corner) for mount in sonar_mounts(vehicle)),
        margin=settings.margin,
        react=settings.react,
        deceleration=settings.deceleration,
    )


def _axis(mount: Mount, corner: float) -> Axis:
    along, across = math.cos(mount.yaw), math.sin(mount.yaw)
    flank = mount.name in ("left", "right")
    return Axis(along, mount.x * across - mount.y * along, corner if flank else 0.0)
