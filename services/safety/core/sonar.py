"""One ultrasonic sensor: which distance of it counts, and when its reading is suspect.

**Distance.** A nearer reading counts at once. A farther one counts after three consecutive samples
that are farther by the hysteresis; then the nearest of the three counts. A sample that is faulty
or too near to measure counts as distance zero, so the same rule accepts a sonar again after three
good samples. ``no_echo`` is free space, at infinity.

**Suspicion.** A reading that is constant to the millimetre is not a fault by itself: a wall
alongside gives the same. It contradicts odometry when the vehicle moved along the sonar's axis or
turned, and nothing else explains it:

- from the start, the reading is reduced by the distance that the vehicle came nearer
- after half a metre along the axis, or half a radian of turning, the sonar is *suspect*
- three consecutive samples with another reading end the suspicion

Suspicion never blocks. It limits the speed toward the sonar's sector (``Sonar.cautious``). Sensors
that report their greatest range need it as ``vehicle.sonar_max``: from there on a reading is
``no_echo``. Below that they seem constant, and the vehicle creeps.
"""

import math

from msgspec import Struct
from msgspec.structs import replace

from t2.messages import RangeStatus

FARTHER_SAMPLES = 3
CHANGED_SAMPLES = 3
HYSTERESIS_M = 0.05  # above the noise of a reading
STUCK_TRAVEL_M = 0.5
SAME_M = 0.0015  # the board counts millimetres
STUCK_TURN = 0.5  # rad; a flat surface does not keep its distance over such a turn


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

    def cautious(self, creep_room: float) -> float:
        """Return the distance to plan with; ``creep_room`` is the distance for the creep speed."""
        doubted = 0.0 if self.suspect else self.same - self.nearer
        return min(self.distance, max(doubted, creep_room))


class Moved(Struct, frozen=True):
    """Motion since the last sample, and what else explains a constant reading."""

    along: float = 0.0  # m along the axis, toward the sector
    turn: float = 0.0  # rad
    alongside: bool = False  # whether a surface alongside explains it


def updated(sonar: Sonar, distance: float, fault: str, moved: Moved) -> Sonar:
    """Return the sonar after one sample, as ``trusted`` reads it."""
    if fault:
        return Sonar(fault=fault)
    return _accept(_watch(sonar, distance, moved), distance)


def trusted(reading: float | None, status: RangeStatus) -> tuple[float, str]:
    """Return the distance of one sample, and the reason if it has none; then it is 0."""
    if status == "no_echo":
        return math.inf, ""
    if status != "ok":
        return 0.0, {"fault": "faulty", "too_near": "too_near"}[status]
    if reading is None or reading < 0:
        return 0.0, "faulty"
    return reading, ""


def _accept(sonar: Sonar, distance: float) -> Sonar:
    # A faulty sonar has no distance to compare with: any good readings end the fault. A near one
    # that did not would leave the obstacle unseen, and an operator may creep toward that.
    if not sonar.fault:
        if distance <= sonar.distance:
            return replace(sonar, distance=distance, farther=())
        if distance < sonar.distance + HYSTERESIS_M:
            return replace(sonar, farther=())
    farther = (*sonar.farther, distance)
    if len(farther) < FARTHER_SAMPLES:
        return replace(sonar, farther=farther)
    return replace(sonar, distance=min(farther), fault="", farther=())


def _watch(sonar: Sonar, distance: float, moved: Moved) -> Sonar:
    """Compare the reading with the previous one and with the motion."""
    if math.isinf(distance) or abs(distance - sonar.same) >= SAME_M:
        changed = sonar.changed + 1
        if sonar.suspect and changed < CHANGED_SAMPLES:
            return replace(sonar, changed=changed)
        return _begin(sonar, distance)
    turned = sonar.turned + moved.turn
    nearer, travel = (0.0, 0.0) if moved.alongside else _span(sonar, moved.along)
    against = travel >= STUCK_TRAVEL_M or abs(turned) >= STUCK_TURN
    suspect = against or (sonar.suspect and not moved.alongside)
    return replace(sonar, nearer=nearer, travel=travel, turned=turned, suspect=suspect, changed=0)


def _begin(sonar: Sonar, same: float) -> Sonar:
    return replace(sonar, same=same, nearer=0.0, travel=0.0, turned=0.0, suspect=False, changed=0)


def _span(sonar: Sonar, along: float) -> tuple[float, float]:
    """Return how much nearer the vehicle came, and its travel along the axis."""
    nearer = sonar.nearer + along
    farther = max(0.0, -nearer)  # beyond the farthest place so far
    return nearer + farther, max(sonar.travel + farther, nearer)
