"""Pose, its covariance, and their motion along arcs.

Between two samples the motion is an arc of length ``distance`` and heading change ``turn``. Its
chord has the length ``distance * k(turn)`` and is rotated by half the turn from the old heading:

    k(turn) = sin(turn / 2) / (turn / 2)
    x' = x + distance * k(turn) * cos(heading + turn / 2)
    y' = y + distance * k(turn) * sin(heading + turn / 2)
    heading' = heading + turn

This is exact for a constant curvature, straight on and turning on the spot included. The covariance
is propagated by the derivatives of these equations.

Between two counter samples, the counters give the length and the turn of the trajectory, the
velocities give its shape. ``fitted`` combines both.
"""

import math
from collections.abc import Sequence
from typing import Self

from msgspec import Struct

SMALL_TURN = 1e-4  # rad; below it, the difference in the derivative loses its digits


class Pose(Struct, frozen=True):
    """A pose in ``odom``: metres, radians, heading wrapped to -pi..pi."""

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
        """Return the covariance after a translation (dx, dy) in ``odom``."""
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


class ProcessNoise(Struct, frozen=True):
    """Variances of one arc: of its length, its turn, and its end position in each axis."""

    distance: float
    turn: float
    place: float


class PoseEstimate(Struct, frozen=True):
    """A pose and its covariance."""

    pose: Pose
    covariance: Covariance

    def moved(self, distance: float, turn: float, noise: ProcessNoise) -> "PoseEstimate":
        """Return the estimate after an arc with this process noise."""
        after = self.pose.moved(distance, turn)
        ratio, slope = chord_ratio(turn)
        cos, sin = (f(self.pose.heading + turn / 2) for f in (math.cos, math.sin))
        aside = distance * ratio / 2
        along = distance * slope
        covariance = (
            self.covariance.carried(after.x - self.pose.x, after.y - self.pose.y)
            .plus(noise.distance, ratio * cos, ratio * sin, 0.0)
            .plus(noise.turn, along * cos - aside * sin, along * sin + aside * cos, 1.0)
            .plus(noise.place, 1.0, 0.0, 0.0)
            .plus(noise.place, 0.0, 1.0, 0.0)
        )
        return PoseEstimate(after, covariance)


class ArcSegment(Struct, frozen=True):
    """One arc; ``seen`` if a velocity was valid, otherwise only its duration is known."""

    distance: float  # m, forward positive
    turn: float  # rad, counter-clockwise positive
    time_s: float
    seen: bool


def total(segments: Sequence[ArcSegment]) -> ArcSegment:
    """Return the sum of segments; it is seen if all of them are."""
    return ArcSegment(
        sum(segment.distance for segment in segments),
        sum(segment.turn for segment in segments),
        sum(segment.time_s for segment in segments),
        all(segment.seen for segment in segments),
    )


def fitted(segments: Sequence[ArcSegment], distance: float, turn: float) -> list[ArcSegment]:
    """Return the segments, corrected to the counters' distance and turn.

    The difference is distributed over the unseen segments by time, or over all if all are seen.
    """
    whole = total(segments)
    if whole.time_s <= 0:
        return [ArcSegment(distance, turn, 0.0, seen=True)]
    unseen_s = sum(segment.time_s for segment in segments if not segment.seen)
    corrected_s = whole.time_s if whole.seen else unseen_s
    linear, angular = (distance - whole.distance) / corrected_s, (turn - whole.turn) / corrected_s
    return [
        segment if segment.seen and not whole.seen else _adjusted(segment, linear, angular)
        for segment in segments
    ]  # fmt: skip


def halved(segments: Sequence[ArcSegment]) -> list[ArcSegment]:
    """Return the same trajectory in half as many, coarser segments."""
    return [total(segments[i : i + 2]) for i in range(0, len(segments), 2)]


def _adjusted(segment: ArcSegment, linear: float, angular: float) -> ArcSegment:
    distance = segment.distance + linear * segment.time_s
    turn = segment.turn + angular * segment.time_s
    return ArcSegment(distance, turn, segment.time_s, segment.seen)
