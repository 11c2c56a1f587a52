"""A guided drive in simulated time: the manoeuvres that ``t2 fit`` needs, as they are recorded."""

from typing import Any

from cli.fit.fit import Fit, fit
from cli.fit.streams import Streams
from cli.settings import Everything
from t2 import keys
from t2.messages import Drive
from verification.search.stack import Stack

RECORDED = (
    keys.VELOCITY, keys.MILEAGE, keys.ULTRASONIC, keys.BUMPER, keys.LINK, keys.MOTION
)  # fmt: skip
SPEEDS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # of the greatest allowed speed
SLOW = 0.7  # likewise, of slow-downs
READY_MS, REST_MS, FULL_MS = 2000, 1500, 1000
SLOWEST = 0.5  # acceleration and deceleration, m/s^2 and rad/s^2
ROUNDS = 3
STILL = Drive(linear=0.0, angular=0.0, echo=0)


class GuidedDrive:
    """Drives a vehicle in a free room; ``streams`` are what a recorder on board would hold."""

    def __init__(self, stack: Stack) -> None:
        self.streams = Streams()
        self._stack = stack
        self._teleop = stack.sources["teleop"]
        for topic in RECORDED:
            stack.hand.subscribe(topic, self._record, depth=64)

    def run(self, settings: Everything) -> Fit:
        """Drive all manoeuvres, and those that were disturbed again, twice; return the fit.

        A proposal beside missing manoeuvres, as of a unit, must be set first.
        """
        self._hold(STILL, READY_MS)
        body = settings.vehicle
        for _ in range(ROUNDS):
            for share in SPEEDS:
                for sign in (1, -1):
                    self._stop(Drive(linear=sign * share * body.max_linear, angular=0.0, echo=0))
                    self._stop(Drive(linear=0.0, angular=sign * share * body.max_angular, echo=0))
            for sign in (1, -1):
                self._slow(Drive(linear=sign * SLOW * body.max_linear, angular=0.0, echo=0))
                self._slow(Drive(linear=0.0, angular=sign * SLOW * body.max_angular, echo=0))
            self.streams.sort()
            found = fit([self.streams], settings)
            if found.proposals or not found.missing:
                break
        return found

    def _slow(self, request: Drive) -> None:
        """Reach a speed, and let RUN slow the vehicle down, three times."""
        ramp_ms = 1000 * max(abs(request.linear), abs(request.angular)) / SLOWEST
        for _ in range(3):
            self._hold(request, round(ramp_ms) + FULL_MS)
            self._hold(STILL, REST_MS + round(ramp_ms))

    def _stop(self, request: Drive) -> None:
        """Reach a speed, and fall silent until the vehicle rests."""
        ramp_ms = 1000 * max(abs(request.linear), abs(request.angular)) / SLOWEST
        self._hold(request, round(ramp_ms) + FULL_MS)
        self._hold(None, REST_MS + round(ramp_ms))
        if self._stack.seen and self._stack.seen.latched:  # a vehicle that rolls on a slope
            self._stack.reset()
        self._hold(STILL, REST_MS)

    def _hold(self, request: Drive | None, duration_ms: int) -> None:
        self._teleop.message = request
        self._stack.run(duration_ms)

    def _record(self, arrival: Any) -> None:
        self.streams.add(arrival.message)
