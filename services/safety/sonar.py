"""What each sonar may be trusted with: a distance, or nothing at all.

A nearer reading counts at once. A farther one counts after three samples in a row that are farther
by the hysteresis, and then the nearest of the three. A sample that is faulty, too near to measure,
stuck or not a number counts as distance zero, so the same rule lets a sonar back in after three
good samples. ``no_echo`` is free space, at infinity.

Stuck is a reading that stays the same to the millimetre while the vehicle has travelled along the
sonar's axis: echoes of a real wall vary.
"""

import math

from msgspec import Struct
from msgspec.structs import replace

from common.messages import RangeStatus

FARTHER_SAMPLES = 3
SAME_M = 0.0015  # the board counts millimetres


class Sonar(Struct, frozen=True):
    """One sonar; ``fault`` is empty when its distance can be trusted."""

    distance: float = 0.0  # m; 0 while it has a fault, infinity for no echo
    fault: str = "silent"
    farther: tuple[float, ...] = ()  # readings that wait to count
    same: float = math.inf  # m, the reading that has not changed
    travel: float = 0.0  # m along the axis since it changed


def read(
    sonar: Sonar, reading: float | None, status: RangeStatus, moved: float, rules: "Rules"
) -> Sonar:
    """Take one sample, ``moved`` metres along the axis after the one before."""
    distance, fault = _trust(reading, status)
    sonar = _watch_change(sonar, distance, moved)
    if not fault and sonar.travel >= rules.stuck_travel:
        fault = "stuck"
    if fault:
        return replace(sonar, distance=0.0, fault=fault, farther=())
    if distance <= sonar.distance:
        return replace(sonar, distance=distance, farther=())
    if distance < sonar.distance + rules.hysteresis:
        return replace(sonar, farther=())
    farther = (*sonar.farther, distance)
    if len(farther) < FARTHER_SAMPLES:
        return replace(sonar, farther=farther)
    return replace(sonar, distance=min(farther), fault="", farther=())


class Rules(Struct, frozen=True):
    """When a reading is believed; metres."""

    hysteresis: float
    stuck_travel: float


def _trust(reading: float | None, status: RangeStatus) -> tuple[float, str]:
    """Return the distance that one sample shows, or why it shows none."""
    if status == "no_echo":
        return math.inf, ""
    if status != "ok":
        return 0.0, {"fault": "faulty", "too_near": "too near to measure"}[status]
    if reading is None or not math.isfinite(reading) or reading < 0:
        return 0.0, "faulty"
    return reading, ""


def _watch_change(sonar: Sonar, distance: float, moved: float) -> Sonar:
    if math.isfinite(distance) and abs(distance - sonar.same) < SAME_M:
        return replace(sonar, travel=sonar.travel + abs(moved))
    return replace(sonar, same=distance, travel=0.0)
