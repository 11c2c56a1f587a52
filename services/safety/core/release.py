"""Release: motion off a pressed bumper while an operator requests it, in the operator's direction.

The single bumper bit has no direction, so safety does not choose one. This state lasts as long as
``contact`` is latched, over every press: the total travel, and the directions in which the bumper
was pressed again. Travel is the largest of commanded speed, measured speed and the board's counter,
so neither slipping nor locked wheels hide it. Travel while the vehicle slows to standstill counts
too. A restart of safety loses this state, so a contact that is latched beside ``predecessor`` gets
no release: it may be an old one.

"Again" means the first pressed sample after a clear one. The bridge reports a clear bumper only
after three clear answers of the board, so a short gap within one press is not a second press.

A release begins as every drive does: with a neutral request, after the press and after the last
refusal. So a key that was held before moves nothing.

``Leg`` informs the operator which direction is believed free, and why. It decides nothing. One
velocity is not evidence of a direction, because a vehicle rebounds from a hit.
"""

import math

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import STILL, Twist
from common.standstill import comparable
from services.safety.core.causes import Held
from t2.messages import Direction, Mileage, Phrases

# After the last motion: a press and counted travel still belong to the release.
COAST_NS = NS_PER_S // 2
SIGN: dict[Direction, float] = {"forward": 1.0, "backward": -1.0}
STEP_M = 0.005  # smaller changes are resolution or noise of the counter
LEG_M = 0.05  # a shorter motion may be a rebound
TURN_RAD = 0.35  # a larger turn on the spot invalidates earlier travel


class Leg(Struct, frozen=True):
    """The newest motion in one direction, by the board's counters."""

    start: Mileage | None = None
    end: Mileage | None = None  # the farthest reading from there
    ended_ns: int | None = None  # time of that

    @property
    def travelled(self) -> float:
        """The travel in metres, forward positive."""
        return self.end.distance - self.start.distance if self.start and self.end else 0.0

    @property
    def direction(self) -> Direction | None:
        """Direction of travel; None when it is too short to show one."""
        if abs(self.travelled) < LEG_M:
            return None
        return "forward" if self.travelled > 0 else "backward"

    def follow(self, counters: Latest[Mileage]) -> "Leg":
        """Return the leg after a reading of the counters."""
        reading = counters.value
        if self.end is None or not comparable(self.end, reading):
            return Leg(reading, reading)
        step = reading.distance - self.end.distance
        reverses = step * self.travelled < 0
        if abs(step) >= (LEG_M if reverses else STEP_M):
            return Leg(self.end if reverses else self.start, reading, counters.received_ns)
        turned = math.remainder(reading.heading - self.end.heading, math.tau)
        return Leg(reading, reading) if abs(turned) > TURN_RAD else self


class Release(Struct, frozen=True):
    """One latched contact, and the travel of its releases."""

    integrated: float = 0.0  # m, by the larger of commanded and measured speed
    counted: float = 0.0  # m, by the board's counter
    counter: Mileage | None = None  # the newest reading while a release moves the vehicle
    source: str = ""  # of the newest release
    direction: Direction | None = None  # in which it may move the vehicle now
    moved: Direction | None = None  # in which a release last moved the vehicle
    moved_ns: int | None = None  # when
    forbidden: frozenset[Direction] = frozenset()
    unknown: bool = False  # whether releases before a restart of safety may have moved the vehicle
    barred_ns: int = 0  # a release begins only with a newer neutral request
    refusal: Phrases = ()  # why a requested release does not move the vehicle
    came: Leg = Leg()  # the leg that led to the newest press outside a release

    @property
    def travelled(self) -> float:
        """Travel of all releases of this contact, in metres."""
        return max(self.integrated, self.counted)

    def remaining(self, distance: float) -> float:
        """Return the remaining travel in metres, of ``distance`` for each contact."""
        return 0.0 if self.unknown else max(0.0, distance - self.travelled)

    def away(self, speed: float) -> Twist:
        """Return the straight motion in the granted direction."""
        return STILL if self.direction is None else Twist(speed * SIGN[self.direction])

    def moving(
        self, sent: Twist | None, known: Twist | None, counter: Mileage | None,
        *, reach: float, dt_s: float, now_ns: int,
    ) -> "Release":  # fmt: skip
        """Return the release ``dt_s`` seconds later.

        ``sent`` is the twist that a release commanded in that time, ``known`` the measured
        velocity; both may be None.
        """
        if sent is None and not self._is_coasting(now_ns):
            return replace(self, counter=counter)
        moves = sent is not None or known is None or not known.is_standing
        speed = max(sweep(sent or STILL, reach), sweep(known or STILL, reach))
        return replace(
            self,
            integrated=self.integrated + speed * dt_s,
            counted=self.counted + _between(self.counter, counter),
            counter=counter or self.counter,
            moved=self.direction if sent is not None and not sent.is_zero else self.moved,
            moved_ns=now_ns if moves else self.moved_ns,
        )

    def after(self, old: Held | None, contact: Held, came: Leg, now_ns: int) -> "Release":
        """Return the release after a bumper sample: ``contact`` as held now, ``old`` before."""
        if old is None:
            return Release(barred_ns=now_ns, came=came)
        if contact.good or not old.good:
            return self  # a clear bumper, or the same press
        forbidden = self.forbidden
        if self.moved is not None and self._is_coasting(now_ns):
            forbidden, came = forbidden | {self.moved}, self.came
        return replace(self, forbidden=forbidden, direction=None, barred_ns=now_ns, came=came)

    def _is_coasting(self, now_ns: int) -> bool:
        return self.moved_ns is not None and now_ns - self.moved_ns <= COAST_NS


def stopping_distance(speed: float, react: float, deceleration: float) -> float:
    """Return the distance (m) from the command to standstill that safety reckons with."""
    return speed * react + speed * speed / (2 * deceleration)


def sweep(twist: Twist, reach: float) -> float:
    """Return a bound on the speed (m/s) of any point within ``reach`` metres of the middle."""
    return abs(twist.linear) + abs(twist.angular) * reach


def _between(old: Mileage | None, new: Mileage | None) -> float:
    """Return the travel (m) between two readings; 0 when they are not comparable."""
    if old is None or new is None or not comparable(old, new):
        return 0.0
    return abs(new.distance - old.distance)
