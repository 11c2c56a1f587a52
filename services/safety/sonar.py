"""Plausibility of one sonar: a distance, a doubtful distance, or no reading.

A nearer reading counts at once. A farther one counts after three consecutive samples that are
farther by the hysteresis; then the nearest of the three counts. A sample that is faulty, too near
to measure or not finite counts as distance zero, so the same rule accepts a sonar again after three
good samples. ``no_echo`` is free space, at infinity.

A reading that is constant to the millimetre is not a fault by itself: a wall alongside, or a
surface beyond the sensor's range, gives the same. It contradicts odometry when the vehicle moved
along the sonar's axis or turned, and nothing else explains it (``sonar_array.py``):

- from the start, the reading is reduced by the distance that the vehicle came nearer
- after ``stuck_travel`` along the axis, or half a radian of turning, the sonar is *suspect*
- three consecutive samples with another reading end the suspicion

Suspicion never blocks. It limits the speed toward the sonar's sector (``Sonar.cautious``).
"""

import math

from msgspec import Struct
from msgspec.structs import replace

from common.messages import RangeStatus

FARTHER_SAMPLES = 3
CHANGED_SAMPLES = 3
SAME_M = 0.0015  # the board counts millimetres
STUCK_TURN = 0.5  # rad; a flat surface does not keep its distance over such a turn
UNSEEN = ("faulty", "silent")  # faults without a reading; "too near" is an obstacle


class Sonar(Struct, frozen=True):
    """State of one sonar; ``fault`` is empty when it gives a distance."""

    distance: float = 0.0  # m; 0 while it has a fault, infinity for no echo
    fault: str = "silent"
    farther: tuple[float, ...] = ()  # farther readings, not yet accepted
    same: float = math.inf  # m, the constant reading
    nearer: float = 0.0  # m that the vehicle came nearer since, from the farthest place
    travel: float = 0.0  # m along the axis since, between the extremes
    turned: float = 0.0  # rad since
    suspect: bool = False
    changed: int = 0  # samples in a row that contradict the suspicion

    @property
    def is_unseen(self) -> bool:
        """Whether it has no reading."""
        return self.fault in UNSEEN

    def cautious(self, creep_room: float) -> float:
        """Return the distance to plan with; ``creep_room`` is the distance for the creep speed."""
        doubted = 0.0 if self.suspect else self.same - self.nearer
        return min(self.distance, max(doubted, creep_room))


class Moved(Struct, frozen=True):
    """Motion since the last sample, and what explains a constant reading."""

    along: float = 0.0  # m along the axis, toward the sector
    turn: float = 0.0  # rad
    beyond: bool = False  # whether the reading is the sensor's greatest range
    alongside: bool = False  # whether a surface alongside explains it


class Rules(Struct, frozen=True):
    """Thresholds in metres."""

    hysteresis: float
    stuck_travel: float  # along the axis without a change, until the sonar is suspect


def read(
    sonar: Sonar, reading: float | None, status: RangeStatus, moved: Moved, rules: Rules
) -> Sonar:
    """Return the sonar after one sample."""
    distance, fault = _trust(reading, status)
    if fault:
        return Sonar(fault=fault)
    return _accept(_watch(sonar, distance, moved, rules.stuck_travel), distance, rules.hysteresis)


def _trust(reading: float | None, status: RangeStatus) -> tuple[float, str]:
    """Return the distance of one sample, or the reason why it has none."""
    if status == "no_echo":
        return math.inf, ""
    if status != "ok":
        return 0.0, {"fault": "faulty", "too_near": "too near to measure"}[status]
    if reading is None or not math.isfinite(reading) or reading < 0:
        return 0.0, "faulty"
    return reading, ""


def _accept(sonar: Sonar, distance: float, hysteresis: float) -> Sonar:
    # A faulty sonar has no distance to compare with: any good readings end the fault. A near one
    # that did not would leave the obstacle unseen, and an operator may creep toward that.
    if not sonar.fault:
        if distance <= sonar.distance:
            return replace(sonar, distance=distance, farther=())
        if distance < sonar.distance + hysteresis:
            return replace(sonar, farther=())
    farther = (*sonar.farther, distance)
    if len(farther) < FARTHER_SAMPLES:
        return replace(sonar, farther=farther)
    return replace(sonar, distance=min(farther), fault="", farther=())


def _watch(sonar: Sonar, distance: float, moved: Moved, stuck_travel: float) -> Sonar:
    """Compare the reading with the previous one and with the motion."""
    if math.isinf(distance) or abs(distance - sonar.same) >= SAME_M:
        changed = sonar.changed + 1
        if sonar.suspect and changed < CHANGED_SAMPLES:
            return replace(sonar, changed=changed)
        return _begin(sonar, distance)
    if moved.beyond:
        return _begin(sonar, sonar.same)
    turned = sonar.turned + moved.turn
    nearer, travel = (0.0, 0.0) if moved.alongside else _span(sonar, moved.along)
    against = travel >= stuck_travel or abs(turned) >= STUCK_TURN
    suspect = against or (sonar.suspect and not moved.alongside)
    return replace(sonar, nearer=nearer, travel=travel, turned=turned, suspect=suspect, changed=0)


def _begin(sonar: Sonar, same: float) -> Sonar:
    return replace(sonar, same=same, nearer=0.0, travel=0.0, turned=0.0, suspect=False, changed=0)


def _span(sonar: Sonar, along: float) -> tuple[float, float]:
    """Return how much nearer the vehicle came, and its travel along the axis."""
    nearer = sonar.nearer + along
    farther = max(0.0, -nearer)  # beyond the farthest place so far
    return nearer + farther, max(sonar.travel + farther, nearer + farther)
