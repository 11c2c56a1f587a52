"""Plane geometry of the simulated world: poses, segments, rays and distances of a rectangle.

Metres and radians, x east, y north, headings counter-clockwise from x. The body is a rectangle
around its pose, length along the heading.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

EDGE = 1e-9  # m, rounding at the side of a cone


@dataclass(frozen=True, slots=True)
class Pose:
    """A position in the world and a heading, not wrapped."""

    x: float
    y: float
    heading: float

    def outward(self, x: float, y: float) -> tuple[float, float]:
        """Transform a point of this pose's frame to the world."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + cos * x - sin * y, self.y + sin * x + cos * y


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight surface segment, from a to b."""

    ax: float
    ay: float
    bx: float
    by: float

    def seen_from(self, pose: Pose) -> Self:
        """Transform the segment to the frame of a pose."""
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        ax, ay, bx, by = self.ax - pose.x, self.ay - pose.y, self.bx - pose.x, self.by - pose.y
        return type(self)(
            cos * ax + sin * ay, cos * ay - sin * ax, cos * bx + sin * by, cos * by - sin * bx
        )


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Half the length along x and half the width along y, around the origin of its frame."""

    half_length: float
    half_width: float

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Return the four corners, counter-clockwise from the front left."""
        x, y = self.half_length, self.half_width
        return (x, y), (-x, y), (-x, -y), (x, -y)

    def outline(self, pose: Pose) -> tuple[Segment, ...]:
        """Return its four sides in the world."""
        ends = [pose.outward(x, y) for x, y in self.corners()]
        return tuple(Segment(*a, *b) for a, b in zip(ends, [*ends[1:], ends[0]], strict=True))

    def touches(self, pose: Pose, segment: Segment) -> bool:
        """Return whether any point of the segment lies in it or on its edge."""
        own = segment.seen_from(pose)
        enter, leave = 0.0, 1.0  # the part of the segment that is inside every strip so far
        for start, end, half in (
            (own.ax, own.bx, self.half_length),
            (own.ay, own.by, self.half_width),
        ):
            delta = end - start
            if delta == 0:
                if abs(start) > half:
                    return False
                continue
            near, far = sorted(((-half - start) / delta, (half - start) / delta))
            enter, leave = max(enter, near), min(leave, far)
        return enter <= leave

    def holds(self, pose: Pose, x: float, y: float) -> bool:
        """Return whether a point of the world lies in it or on its edge."""
        return self.touches(pose, Segment(x, y, x, y))

    def gap(self, pose: Pose, segment: Segment) -> float:
        """Return the distance to the segment, zero when they touch."""
        if self.touches(pose, segment):
            return 0.0
        own = segment.seen_from(pose)
        ends = ((own.ax, own.ay), (own.bx, own.by))
        return min(
            *(self._gap_to_point(x, y) for x, y in ends),
            *(point_gap(x, y, own) for x, y in self.corners()),
        )

    def _gap_to_point(self, x: float, y: float) -> float:
        return math.hypot(max(0.0, abs(x) - self.half_length), max(0.0, abs(y) - self.half_width))


def point_gap(x: float, y: float, segment: Segment) -> float:
    """Return the distance from a point to a segment."""
    dx, dy = segment.bx - segment.ax, segment.by - segment.ay
    length2 = dx * dx + dy * dy
    along = ((x - segment.ax) * dx + (y - segment.ay) * dy) / length2 if length2 else 0.0
    along = min(1.0, max(0.0, along))
    return math.hypot(x - segment.ax - along * dx, y - segment.ay - along * dy)


def ray(x: float, y: float, angle: float, segment: Segment) -> float:
    """Return the distance from a point along a ray to the segment, or infinity."""
    cos, sin = math.cos(angle), math.sin(angle)
    dx, dy = segment.bx - segment.ax, segment.by - segment.ay
    cross = cos * dy - sin * dx
    if cross == 0:  # parallel
        return math.inf
    rx, ry = segment.ax - x, segment.ay - y
    along, where = (rx * dy - ry * dx) / cross, (rx * sin - ry * cos) / cross
    return along if along >= 0 and 0 <= where <= 1 else math.inf


def in_cone(
    x: float, y: float, middle: float, half: float, segments: Iterable[Segment]
) -> list[Segment]:
    """Return the segments that a cone from x, y may touch, a superset; ``half`` < pi / 2, rad.

    A cheap filter before ``ray``: the others lie beyond one of its two sides.
    """
    right_x, right_y = math.cos(middle - half), math.sin(middle - half)
    left_x, left_y = math.cos(middle + half), math.sin(middle + half)
    kept = []
    for s in segments:
        ax, ay, bx, by = s.ax - x, s.ay - y, s.bx - x, s.by - y
        if right_x * ay - right_y * ax < -EDGE and right_x * by - right_y * bx < -EDGE:
            continue
        if left_x * ay - left_y * ax > EDGE and left_x * by - left_y * bx > EDGE:
            continue
        kept.append(s)
    return kept
