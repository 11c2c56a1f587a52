"""Verdict on a run without faults: stops that nothing justified, and the honesty of odometry."""

import math
from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from common.freshness import NS_PER_S
from sim.geometry import Pose
from sim.trace import Truth
from t2 import messages as m

# A wall nearer than this justifies a stop: safety's margin of 0.20 m, its reaction at 1 m/s, the
# hysteresis of 0.05 m and the errors of the sonars.
NEAR_M = 0.60
AGO_S = 1.0  # a contact or a wall justifies a stop for this long
ASKED_S = 0.2  # a request needs this long to show
READY_S = 4.0  # from the start until the vehicle may drive
ROLLED_M = 0.03  # from a standstill, by a slope; safety trips after 0.05 m
MOVES_MPS, MOVES_RADPS = 0.02, 0.03
TRANSIENT = ("blocked", "no_request", "two_publishers")
FOLLOWING = ("neutral",)  # another cause came first
CHI2_95 = 7.81  # three degrees of freedom


class Stop(Struct, frozen=True):
    """A stop that nothing justified."""

    at_s: float
    cause: str
    text: str


class Judge:
    """Looks at safety's state and the truth 20 times a second."""

    def __init__(self, start_ns: int) -> None:
        self.stops: list[Stop] = []
        self._start_ns = start_ns
        self._judged: set[int] = set()  # occurrences of causes
        self._near_ns = self._contact_ns = self._moved_ns = -NS_PER_S * 10
        self._stood_m: float | None = None  # the way driven when it came to stand

    def look(
        self, causes: Sequence[m.Cause], asks_since_ns: int | None, truth: Truth, now_ns: int
    ) -> None:
        """Judge the causes that an operator sees, and the requests for motion since then."""
        self._note(truth, now_ns)
        at_s = (now_ns - self._start_ns) / NS_PER_S
        if at_s < READY_S:
            return
        asks = asks_since_ns is not None and now_ns - asks_since_ns > ASKED_S * NS_PER_S
        for cause in causes:
            if cause.id in self._judged or cause.action == "slow":
                continue
            if cause.name in TRANSIENT and not asks:
                continue
            if not self._justified(cause, truth, now_ns):
                self.stops.append(Stop(round(at_s, 2), cause.name, cause.text))
            self._judged.add(cause.id)

    def _note(self, truth: Truth, now_ns: int) -> None:
        """Note what may justify a stop."""
        if truth.contact or truth.pressed:
            self._contact_ns = now_ns
        if truth.clearance is not None and truth.clearance < NEAR_M:
            self._near_ns = now_ns
        if _moves(truth):
            self._moved_ns = now_ns
        if truth.command.linear or truth.command.angular:
            self._stood_m = None  # a neutral RUN is a standstill command, too
        elif self._stood_m is None and not _moves(truth):
            self._stood_m = truth.distance

    def _justified(self, cause: m.Cause, truth: Truth, now_ns: int) -> bool:
        if cause.name in FOLLOWING:
            return True
        if cause.name == "blocked":
            return now_ns - self._near_ns < AGO_S * NS_PER_S
        if cause.name == "contact":
            return now_ns - self._contact_ns < AGO_S * NS_PER_S
        if cause.name == "not_stopping":
            return now_ns - self._moved_ns < AGO_S * NS_PER_S  # BRAKE may have stopped it since
        if cause.name == "uncommanded_motion":
            return self._stood_m is not None and truth.distance - self._stood_m > ROLLED_M
        return False


def _moves(truth: Truth) -> bool:
    return abs(truth.linear) > MOVES_MPS or abs(truth.angular) > MOVES_RADPS


class PoseError(Struct, frozen=True):
    """Odometry against the truth."""

    position: float  # m
    heading: float  # rad
    nees: float  # normalised estimation error squared; 3 on average if the covariance is honest


def pose_error(odometry: m.Odometry, truth: Pose, start: Pose) -> PoseError:
    """Return the error of odometry, whose frame is the start's."""
    dx, dy = truth.x - start.x, truth.y - start.y
    cos, sin = math.cos(start.heading), math.sin(start.heading)
    error = (
        odometry.x - (cos * dx + sin * dy),
        odometry.y - (cos * dy - sin * dx),
        math.remainder(odometry.heading - (truth.heading - start.heading), math.tau),
    )
    position = math.hypot(error[0], error[1])
    return PoseError(position, abs(error[2]), normalised(error, odometry.pose_covariance))


def normalised(error: Sequence[float], covariance: Sequence[float]) -> float:
    """Return the squared error in units of its covariance, 3x3 row by row."""
    solved = np.linalg.solve(np.reshape(covariance, (3, 3)), error)
    return float(np.dot(error, solved))
