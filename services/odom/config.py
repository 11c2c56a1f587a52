"""Settings of odometry.

Each noise is the standard deviation after one unit of distance, turn or time. Its variance grows
proportionally, so the result does not depend on the sample rate. The defaults are estimates for a
vehicle on hard floor; they have not been measured.
"""

from typing import Annotated

from msgspec import Meta

from common import settings

Noise = Annotated[float, Meta(gt=0.0, le=10.0)]


class Odom(settings.Section, frozen=True, kw_only=True):
    """Parameters of the pose estimate."""

    hold: Annotated[float, Meta(ge=0.02, le=0.5)] = 0.1  # s that a velocity is valid

    distance_noise: Noise = 0.01  # m per sqrt(m) driven
    turn_noise: Noise = 0.02  # rad per sqrt(rad) turned
    drift_noise: Noise = 0.01  # rad per sqrt(m) driven
    velocity_noise: Noise = 0.02  # m/s, of one velocity; correlated over about a second
    angular_noise: Noise = 0.02  # rad/s, likewise
    gap_noise: Noise = 0.2  # m per sqrt(m) driven in a gap, per sqrt(s) while it lasts
    gap_turn_noise: Noise = 0.3  # rad per sqrt(s) of a gap while it lasts

    slip_distance: Annotated[float, Meta(ge=0.02, le=2.0)] = 0.1  # m in a second
    slip_turn: Annotated[float, Meta(ge=0.02, le=2.0)] = 0.2  # rad in a second


class OdomConfig(settings.Shared, frozen=True, kw_only=True):
    """The sections that odometry reads."""

    odom: Odom = Odom()
