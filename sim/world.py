"""World model: walls and boxes, visible to sonar or only to the bumper.

A plan is the content of a world file; the world is the plan as surfaces.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Self

from msgspec import Meta, Struct

from sim.geometry import Pose, Rectangle, Segment, point_gap

PERSON = 0.4  # m, length and width
BUMPER_TRAVEL = 0.005  # m; travel of the strip until the body itself touches

Side = Annotated[float, Meta(ge=0.01, le=100.0)]
Coordinate = Annotated[float, Meta(ge=-1000.0, le=1000.0)]  # m; a limit also refuses NaN
Angle = Annotated[float, Meta(ge=-100.0, le=100.0)]  # rad
Point = tuple[Coordinate, Coordinate]


class Part(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One table of a world file."""


class Spot(Part, frozen=True, kw_only=True):
    """A pose, such as the start of the vehicle."""

    x: Coordinate  # m
    y: Coordinate  # m
    heading: Angle = 0.0  # rad

    @property
    def pose(self) -> Pose:
        """The pose."""
        return Pose(self.x, self.y, self.heading)


class Box(Spot, frozen=True, kw_only=True):
    """A rectangle on the floor around its pose; a low one is below all sonar beams."""

    name: str
    length: Side  # m, along the heading
    width: Side  # m
    low: bool = False

    @property
    def shape(self) -> Rectangle:
        """Its rectangle."""
        return Rectangle(self.length / 2, self.width / 2)


class Wall(Part, frozen=True, kw_only=True):
    """A line through points, thin and high."""

    points: Annotated[tuple[Point, ...], Meta(min_length=2)]

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Its segments."""
        return tuple(
            Segment(*a, *b) for a, b in zip(self.points[:-1], self.points[1:], strict=True)
        )


class Plan(Part, frozen=True, kw_only=True):
    """A world file."""

    title: str
    start: Spot = Spot(x=0.0, y=0.0)
    walls: tuple[Wall, ...] = ()
    boxes: tuple[Box, ...] = ()


@dataclass(frozen=True)
class World:
    """Walls and boxes as surfaces."""

    walls: tuple[Segment, ...]
    boxes: tuple[Box, ...]

    @classmethod
    def of(cls, plan: Plan) -> Self:
        """Build the world of a plan."""
        return cls(tuple(s for wall in plan.walls for s in wall.segments), plan.boxes)

    @cached_property
    def visible(self) -> tuple[Segment, ...]:
        """The surfaces visible to sonar."""
        return self.walls + _outlines(box for box in self.boxes if not box.low)

    @cached_property
    def solid(self) -> tuple[Segment, ...]:
        """All surfaces."""
        return self.visible + _outlines(box for box in self.boxes if box.low)

    def blocks(self, body: Rectangle, pose: Pose) -> bool:
        """Return whether a body at this pose collides."""
        if any(box.shape.holds(box.pose, pose.x, pose.y) for box in self.boxes):
            return True
        return any(body.touches(pose, segment) for segment in _near(self.solid, body, pose, 0.0))

    def contact(self, body: Rectangle, pose: Pose) -> bool:
        """Return whether something presses the bumper strip around the body."""
        near = _near(self.solid, body, pose, BUMPER_TRAVEL)
        return any(body.gap(pose, segment) <= BUMPER_TRAVEL for segment in near)

    def clearance(self, body: Rectangle, pose: Pose) -> float:
        """Return the distance to the nearest surface visible to sonar, in metres, or infinity."""
        return min((body.gap(pose, segment) for segment in self.visible), default=math.inf)


def person_at(pose: Pose) -> Box:
    """Return a person as a box."""
    return Box(name="person", x=pose.x, y=pose.y, heading=pose.heading, length=PERSON, width=PERSON)


def _outlines(boxes: Iterable[Box]) -> tuple[Segment, ...]:
    return tuple(side for box in boxes for side in box.shape.outline(box.pose))


def _near(
    segments: tuple[Segment, ...], body: Rectangle, pose: Pose, margin: float
) -> Iterable[Segment]:
    """Yield the segments that may be within the margin of the body: a cheap filter."""
    reach = math.hypot(body.half_length, body.half_width) + margin
    return (s for s in segments if point_gap(pose.x, pose.y, s) <= reach)
