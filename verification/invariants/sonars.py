"""Sonars of the vehicle for the oracle: place, direction, reading, approach.

As in ``safety_book.py``, nothing is taken from the code under test.
"""

import math

from common.messages import Ultrasonic

FRONT, LEFT = 0.55, 0.35  # m from the middle to the bumpers
# Name, place and direction of each sonar, clockwise from the left (manual 2.3).
SONARS = (
    (0.0, LEFT, 90), (FRONT, LEFT, 45), (FRONT, 0.0, 0), (FRONT, -LEFT, -45),
    (0.0, -LEFT, -90), (-FRONT, -LEFT, -135), (-FRONT, 0.0, 180), (-FRONT, LEFT, 135),
)  # fmt: skip
FLANKS = (0, 4)


def shown(message: Ultrasonic, sonar: int) -> float:
    """Return what one sample shows, 0 where nothing can be trusted."""
    reading = message.ranges[sonar]
    if message.status[sonar] == "no_echo":
        return math.inf
    return reading if message.status[sonar] == "ok" and reading is not None else 0.0


def approach(sonar: int, linear: float, angular: float) -> float:
    """Return how fast (m/s) a twist closes in on what a sonar sees."""
    x, y, degrees = SONARS[sonar]
    yaw = math.radians(degrees)
    along = (linear - angular * y) * math.cos(yaw) + angular * x * math.sin(yaw)
    return max(along, abs(angular) * FRONT) if sonar in FLANKS else along
