"""Odometry's settings.

The noises are standard deviations after one unit of what makes them grow; as variances they grow
in proportion, so that it does not matter how often the board is asked. The defaults are guesses for
a vehicle on hard floor until somebody has measured one.
"""

from typing import Annotated

from msgspec import Meta

from common import settings

Noise = Annotated[float, Meta(gt=0.0, le=10.0)]


class Odom(settings.Section, frozen=True, kw_only=True):
    """How pose and its uncertainty follow from counters and velocities."""

    hold: Annotated[float, Meta(ge=0.02, le=0.5)] = 0.1  # s that a velocity stands for the motion

    distance_noise: Noise = 0.01  # m per sqrt(m) driven
    turn_noise: Noise = 0.02  # rad per sqrt(rad) turned
    drift_noise: Noise = 0.01  # rad per sqrt(m) driven
    velocity_noise: Noise = 0.02  # m/s, of one velocity; wrong for about a second at a time
    angular_noise: Noise = 0.02  # rad/s, likewise
    gap_noise: Noise = 0.2  # m per sqrt(m) driven in a gap, per sqrt(s) while it lasts
    gap_turn_noise: Noise = 0.3  # rad per sqrt(s) of a gap while it lasts

    slip_distance: Annotated[float, Meta(ge=0.02, le=2.0)] = 0.1  # m in a second
    slip_turn: Annotated[float, Meta(ge=0.02, le=2.0)] = 0.2  # rad in a second

    path_spacing: Annotated[float, Meta(ge=0.01, le=10.0)] = 0.05  # m between two points
    path_points: Annotated[int, Meta(ge=2, le=100_000)] = 4000  # the oldest go first


class OdomConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that odometry reads."""

    odom: Odom = Odom()
