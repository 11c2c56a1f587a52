"""Motion of the pose and its covariance along arcs.

Between two samples the motion is an arc of length ``distance`` and heading change ``turn``
(``common/pose.py``). The covariance is propagated by the derivatives of its equations.

Between two counter samples, the counters give the length and the turn of the trajectory, the
velocities give its shape. ``fitted`` combines both.
"""

import math
from collections.abc import Sequence

from msgspec import Struct

from common.pose import Covariance, Pose, chord_ratio


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
