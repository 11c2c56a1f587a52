"""Sonar mounting poses in ``base_link``: x forward, y left, metres and radians."""

import math

from msgspec import Struct

from common.settings import Vehicle


class Mount(Struct, frozen=True):
    """Position and direction of a sonar."""

    name: str
    x: float
    y: float
    yaw: float  # counter-clockwise from straight ahead


def sonar_mounts(vehicle: Vehicle) -> tuple[Mount, ...]:
    """Return the eight sonars in the manual's order, clockwise from the left (manual 2.3)."""
    front, left = vehicle.length / 2, vehicle.width / 2
    degrees = math.radians
    return (
        Mount("left", 0.0, left, degrees(90)),
        Mount("front_left", front, left, degrees(45)),
        Mount("front", front, 0.0, 0.0),
        Mount("front_right", front, -left, degrees(-45)),
        Mount("right", 0.0, -left, degrees(-90)),
        Mount("rear_right", -front, -left, degrees(-135)),
        Mount("rear", -front, 0.0, degrees(180)),
        Mount("rear_left", -front, left, degrees(135)),
    )
