"""Where the vehicle is and how well that is known; how an arc moves both.

Between two looks the vehicle is taken to run on an arc of length ``distance`` that turns it by
``turn``. The arc's chord has the length ``distance * k(turn)`` and points half the turn away from
the heading before:

    k(turn) = sin(turn / 2) / (turn / 2)
    x' = x + distance * k(turn) * cos(heading + turn / 2)
    y' = y + distance * k(turn) * sin(heading + turn / 2)
    heading' = heading + turn

This is exact for a constant curvature, straight on and turning on the spot included. The covariance
is carried on by the derivatives of these lines.
"""

import math
from typing import Self

from msgspec import Struct

SMALL_TURN = 1e-4  # rad; below it, the difference in the derivative loses its digits


class Pose(Struct, frozen=True):
    """A place in ``odom``: metres, radians, heading wrapped to -pi..pi."""

    x: float
    y: float
    heading: float

    def moved(self, distance: float, turn: float) -> "Pose":
        """Return where an arc leads: m, forward positive, and rad, counter-clockwise positive."""
        chord = distance * chord_ratio(turn)[0]
        direction = self.heading + turn / 2
        return Pose(
            self.x + chord * math.cos(direction),
            self.y + chord * math.sin(direction),
            math.remainder(self.heading + turn, math.tau),
        )


def chord_ratio(turn: float) -> tuple[float, float]:
    """Return an arc's chord as a part of its length, and the derivative of that by the turn."""
    if abs(turn) < SMALL_TURN:
        return 1.0 - turn * turn / 24, -turn / 12
    ratio = math.sin(turn / 2) / (turn / 2)
    return ratio, (math.cos(turn / 2) - ratio) / turn


class Covariance(Struct, frozen=True):
    """Of x, y and heading (m², m rad, rad²); six numbers, so that it cannot but be symmetric."""

    xx: float
    xy: float
    yy: float
    xh: float
    yh: float
    hh: float

    def carried(self, dx: float, dy: float) -> Self:
        """Return it after a move by (dx, dy) in ``odom``; the heading's error led aside."""
        return type(self)(
            self.xx - 2 * dy * self.xh + dy * dy * self.hh,
            self.xy - dy * self.yh + dx * self.xh - dx * dy * self.hh,
            self.yy + 2 * dx * self.yh + dx * dx * self.hh,
            self.xh - dy * self.hh,
            self.yh + dx * self.hh,
            self.hh,
        )

    def plus(self, variance: float, x: float, y: float, heading: float) -> Self:
        """Return it with an independent error of this variance along (x, y, heading)."""
        return type(self)(
            self.xx + variance * x * x,
            self.xy + variance * x * y,
            self.yy + variance * y * y,
            self.xh + variance * x * heading,
            self.yh + variance * y * heading,
            self.hh + variance * heading * heading,
        )

    def rows(self) -> tuple[float, ...]:
        """Return it as a 3x3 matrix, row by row."""
        return (self.xx, self.xy, self.xh, self.xy, self.yy, self.yh, self.xh, self.yh, self.hh)


class ProcessNoise(Struct, frozen=True):
    """The variances of one arc: of its length, of its turn, and of its end in every direction."""

    distance: float
    turn: float
    place: float


class PoseEstimate(Struct, frozen=True):
    """A pose and how far it may be off."""

    pose: Pose
    covariance: Covariance

    def moved(self, distance: float, turn: float, spread: ProcessNoise) -> "PoseEstimate":
        """Return the belief after an arc that is itself known with this spread only."""
        after = self.pose.moved(distance, turn)
        ratio, slope = chord_ratio(turn)
        cos, sin = (f(self.pose.heading + turn / 2) for f in (math.cos, math.sin))
        aside = distance * ratio / 2
        along = distance * slope
        covariance = (
            self.covariance.carried(after.x - self.pose.x, after.y - self.pose.y)
            .plus(spread.distance, ratio * cos, ratio * sin, 0.0)
            .plus(spread.turn, along * cos - aside * sin, along * sin + aside * cos, 1.0)
            .plus(spread.place, 1.0, 0.0, 0.0)
            .plus(spread.place, 0.0, 1.0, 0.0)
        )
        return PoseEstimate(after, covariance)
