"""Poses in a plane, and their covariance. Pure.

A motion along an arc of length ``distance`` and heading change ``turn`` ends at the chord of length
``distance * k(turn)``, rotated by half the turn from the old heading:

    k(turn) = sin(turn / 2) / (turn / 2)
    x' = x + distance * k(turn) * cos(heading + turn / 2)
    y' = y + distance * k(turn) * sin(heading + turn / 2)
    heading' = heading + turn

This is exact for a constant curvature, straight on and turning on the spot included.
"""

import math
from collections.abc import Sequence
from typing import Self

from msgspec import Struct
from msgspec.structs import astuple

SMALL_TURN = 1e-4  # rad; below it, the difference in the derivative loses its digits


class Pose(Struct, frozen=True):
    """A pose in a plane: metres, radians, heading wrapped to -pi..pi."""

    x: float
    y: float
    heading: float

    def moved(self, distance: float, turn: float) -> "Pose":
        """Return the pose after an arc: m forward and rad counter-clockwise."""
        chord = distance * chord_ratio(turn)[0]
        direction = self.heading + turn / 2
        return Pose(
            self.x + chord * math.cos(direction),
            self.y + chord * math.sin(direction),
            math.remainder(self.heading + turn, math.tau),
        )

    def then(self, step: "Pose") -> "Pose":
        """Return the pose that is ``step`` as seen from this one."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return Pose(
            self.x + cos * step.x - sin * step.y,
            self.y + sin * step.x + cos * step.y,
            math.remainder(self.heading + step.heading, math.tau),
        )

    def inverse(self) -> "Pose":
        """Return the origin as seen from this pose."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        x, y = -cos * self.x - sin * self.y, sin * self.x - cos * self.y
        return Pose(x, y, math.remainder(-self.heading, math.tau))


def chord_ratio(turn: float) -> tuple[float, float]:
    """Return the ratio of chord to arc length, and its derivative by the turn."""
    if abs(turn) < SMALL_TURN:
        return 1.0 - turn * turn / 24, -turn / 12
    ratio = math.sin(turn / 2) / (turn / 2)
    return ratio, (math.cos(turn / 2) - ratio) / turn


class Covariance(Struct, frozen=True):
    """Covariance of x, y, heading (m², m rad, rad²); six numbers keep it symmetric."""

    xx: float
    xy: float
    yy: float
    xh: float
    yh: float
    hh: float

    def carried(self, dx: float, dy: float) -> Self:
        """Return the covariance after a translation (dx, dy) of the pose, in the same axes."""
        return type(self)(
            self.xx - 2 * dy * self.xh + dy * dy * self.hh,
            self.xy - dy * self.yh + dx * self.xh - dx * dy * self.hh,
            self.yy + 2 * dx * self.yh + dx * dx * self.hh,
            self.xh - dy * self.hh,
            self.yh + dx * self.hh,
            self.hh,
        )

    def plus(self, variance: float, x: float, y: float, heading: float) -> Self:
        """Return the covariance plus an independent error along (x, y, heading)."""
        return type(self)(
            self.xx + variance * x * x,
            self.xy + variance * x * y,
            self.yy + variance * y * y,
            self.xh + variance * x * heading,
            self.yh + variance * y * heading,
            self.hh + variance * heading * heading,
        )

    def rows(self) -> tuple[float, ...]:
        """Return the 3x3 matrix, row by row."""
        return (self.xx, self.xy, self.xh, self.xy, self.yy, self.yh, self.xh, self.yh, self.hh)

    @classmethod
    def of(cls, rows: Sequence[float]) -> Self:
        """Return the covariance of a symmetric 3x3 matrix, row by row."""
        return cls(rows[0], rows[1], rows[4], rows[2], rows[5], rows[8])

    def rotated(self, angle: float) -> Self:
        """Return the covariance in axes that are rotated by ``-angle`` rad."""
        cos, sin = math.cos(angle), math.sin(angle)
        return type(self)(
            cos * cos * self.xx - 2 * cos * sin * self.xy + sin * sin * self.yy,
            cos * sin * (self.xx - self.yy) + (cos * cos - sin * sin) * self.xy,
            sin * sin * self.xx + 2 * cos * sin * self.xy + cos * cos * self.yy,
            cos * self.xh - sin * self.yh,
            sin * self.xh + cos * self.yh,
            self.hh,
        )

    def combined(self, other: "Covariance", sign: float = 1.0) -> Self:
        """Return the sum of two covariances, or with ``sign`` -1 their difference."""
        pairs = zip(astuple(self), astuple(other), strict=True)
        return type(self)(*(a + sign * b for a, b in pairs))

    @property
    def sigma(self) -> float:
        """The greatest standard deviation of the position in any direction, m."""
        mean, difference = (self.xx + self.yy) / 2, (self.xx - self.yy) / 2
        return math.sqrt(max(0.0, mean + math.hypot(difference, self.xy)))

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Half axes of the ellipse of one standard deviation, m; direction of the longer, rad."""
        shorter = (self.xx + self.yy) / 2 - math.hypot((self.xx - self.yy) / 2, self.xy)
        direction = math.atan2(2 * self.xy, self.xx - self.yy) / 2
        return self.sigma, math.sqrt(max(0.0, shorter)), direction

    @property
    def heading_sigma(self) -> float:
        """The standard deviation of the heading, rad."""
        return math.sqrt(max(0.0, self.hh))
