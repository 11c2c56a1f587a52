"""Settings of odometry.

Each noise is the standard deviation after one unit of distance, turn or time. Its variance grows
proportionally, so the result does not depend on the sample rate. The defaults are estimates for a
vehicle on hard floor; they have not been measured (`t2 fit --closed`).
"""

from typing import Annotated

from common import settings
from common.settings import allowed


class Odom(settings.Section, frozen=True, kw_only=True):
    """Parameters of the pose estimate."""

    distance_noise: Annotated[float, allowed("m per sqrt(m) driven", gt=0.0, le=10.0)] = 0.01
    turn_noise: Annotated[float, allowed("rad per sqrt(rad) turned", gt=0.0, le=10.0)] = 0.02
    drift_noise: Annotated[float, allowed("rad per sqrt(m) driven", gt=0.0, le=10.0)] = 0.01
    # of one velocity; correlated over about a second
    velocity_noise: Annotated[float, allowed("m/s", gt=0.0, le=10.0)] = 0.02
    angular_noise: Annotated[float, allowed("rad/s", gt=0.0, le=10.0)] = 0.02  # likewise


class OdomConfig(settings.Shared, frozen=True, kw_only=True):
    """The sections that odometry reads."""

    odom: Odom = Odom()
