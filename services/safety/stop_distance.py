"""Stopping distance: what safety reckons with, and whether a measured stop was longer.

From the speed v the vehicle stops within

    v * t_react + v^2 / (2 a)

The speed limits toward an obstacle follow from this (``zones.py``), so a longer stop uses up the
margin. A stop is measured from the first STOP or BRAKE after a RUN with speed until standstill, by
the integral of the measured velocities:

================================================================= ==================================
before the standstill                                             effect
================================================================= ==================================
two consecutive velocities below the standstill threshold         the stop is compared
motion is commanded again                                         not compared
no velocity for 0.1 s                                             not compared
another boot of the bridge or epoch of the board's counters       not compared
================================================================= ==================================

A vehicle that slows down on RUN, or is pushed while standstill is commanded, is not measured.
"""

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import Twist
from services.safety.config import Safety
from services.safety.inputs import Inputs

SLOWEST_MPS = 0.1  # a slower stop shows nothing: 3 cm
LONGEST_GAP_S = 0.1  # between two velocities; over longer gaps the travel is unknown
# A velocity is up to 20 ms old at the command, and in steps of 1 mm/s for some seconds.
TOLERANCE_S = 0.02
TOLERANCE_M = 0.01

Identity = tuple[int, int]  # the bridge's boot and the board's epoch


class LongStop(Struct, frozen=True):
    """A stop that was longer than reckoned, in m."""

    travel: float
    reckoned: float

    @property
    def text(self) -> str:
        """Text for the operator."""
        return (
            f"The last stop took {self.travel:.2f} m, safety reckons with {self.reckoned:.2f} m: "
            "run `t2 checkout stop`."
        )


class Stop(Struct, frozen=True):
    """A stop that is being measured."""

    reckoned: float  # m
    tolerance: float  # m
    board: Identity | None
    speed: float  # m/s, of the newest velocity
    at_ns: int  # of the newest velocity; of the command before the first
    travel: float = 0.0  # m
    standing: bool = False  # whether the newest velocity is below the standstill threshold


class StopDistance(Struct, frozen=True):
    """The stop that is being measured, and the newest one that was too long."""

    stop: Stop | None = None
    long: LongStop | None = None


class StopGauge(Struct, frozen=True):
    """Measures the stops of one vehicle; holds no state."""

    react: float  # s
    deceleration: float  # m/s^2
    velocity_age: float  # s; an older velocity is unknown

    def follow(
        self, before: StopDistance, sent: Twist | None, running: bool, inputs: Inputs, now_ns: int
    ) -> StopDistance:
        """Return the state after a decision.

        ``sent`` is the twist of the RUN before this decision, None if standstill was commanded;
        ``running`` is whether this decision commands motion.
        """
        if running:
            return before if before.stop is None else replace(before, stop=None)
        if sent is not None:
            return replace(before, stop=self._begin(sent, inputs, now_ns))
        if before.stop is None:
            return before
        return self._advance(before, before.stop, inputs, now_ns)

    def _begin(self, sent: Twist, inputs: Inputs, now_ns: int) -> Stop | None:
        measured = inputs.known_velocity(now_ns, self.velocity_age)
        if measured is None or measured.linear * sent.linear <= 0:
            return None
        speed = abs(measured.linear)
        if speed < SLOWEST_MPS:
            return None
        # A vehicle that still accelerates reaches the commanded speed before it reacts.
        fastest = max(speed, abs(sent.linear))
        return Stop(
            reckoned=stopping_distance(fastest, self.react, self.deceleration),
            tolerance=TOLERANCE_M + TOLERANCE_S * fastest,
            board=_identity(inputs),
            speed=speed,
            at_ns=now_ns,
        )

    def _advance(
        self, before: StopDistance, stop: Stop, inputs: Inputs, now_ns: int
    ) -> StopDistance:
        """Add the newest velocity; compare at standstill."""
        velocity, known = inputs.velocity, inputs.known_velocity(now_ns, self.velocity_age)
        if velocity is None or known is None or _identity(inputs) != stop.board:
            return replace(before, stop=None)
        gap_s = (velocity.received_ns - stop.at_ns) / NS_PER_S
        if gap_s <= 0:
            return before
        if gap_s > LONGEST_GAP_S:
            return replace(before, stop=None)
        speed, standing = abs(known.linear), known.is_standing
        travel = stop.travel + (stop.speed + speed) / 2 * gap_s
        if not (standing and stop.standing):
            at_ns = velocity.received_ns
            stop = replace(stop, speed=speed, at_ns=at_ns, travel=travel, standing=standing)
            return replace(before, stop=stop)
        if travel <= stop.reckoned + stop.tolerance:
            return replace(before, stop=None)
        return StopDistance(long=LongStop(travel, stop.reckoned))


def stop_gauge(settings: Safety) -> StopGauge:
    """Return the gauge for these settings."""
    return StopGauge(settings.react, settings.deceleration, settings.velocity_age)


def stopping_distance(speed: float, react: float, deceleration: float) -> float:
    """Return the distance (m) from the command to standstill that safety reckons with."""
    return speed * react + speed * speed / (2 * deceleration)


def _identity(inputs: Inputs) -> Identity | None:
    """Return the bridge's boot and the board's epoch; None without counters."""
    counters = inputs.mileage
    return None if counters is None else (counters.value.boot, counters.value.epoch)
