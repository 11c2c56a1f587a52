"""Motions by odometry: how much is left, and which velocity to request. Pure."""

import math
from collections import deque
from collections.abc import Iterable
from itertools import islice, pairwise
from typing import Any, Literal, NamedTuple, Protocol, get_args

from t2.messages import MAX_NUMBER

ACCELERATION, TURNING = 0.3, 0.8  # m/s^2, rad/s^2: how a motion slows down towards its end
SLOWEST, SLOWEST_TURN = 0.05, 0.1  # m/s, rad/s: an end that is reached
NEAR, NEAR_TURN = 0.01, 0.02  # m, rad: of the end
STEP, STEP_TURN = 0.001, 0.002  # m, rad: progress
START_S = 0.5  # until a vehicle that stands shows progress: the least patience
RESOLUTION, RESOLUTION_TURN = 0.001, math.radians(0.1)  # m/s, rad/s: of the board's commands
KEEP_HEADING, MAX_CORRECTION = 1.5, 0.4  # rad/s per rad, rad/s
AHEAD, AHEAD_S = 0.3, 1.0  # m and s along a path, of the point that is aimed at: the longer one
FACING, TURNED = 0.8, 0.1  # rad: off the aim, a path is left for a turn on the spot, until turned

CORRECTION, FASTEST = 0.1, 2.0  # m or rad, and that per s: what moves more was corrected

OnStop = Literal["raise", "wait"]
Frame = Literal["odom", "map"]


class Target(NamedTuple):
    """A requested velocity, with its end."""

    linear: float  # m/s
    angular: float  # rad/s
    end_s: float = math.inf  # monotonic time
    on_stop: OnStop = "raise"

    @property
    def moves(self) -> bool:
        """Whether it is not zero."""
        return self.linear != 0 or self.angular != 0


STILL = Target(0.0, 0.0)


class Place(Protocol):
    """A pose in a plane: m, m, rad."""

    @property
    def x(self) -> float: ...  # noqa: D102
    @property
    def y(self) -> float: ...  # noqa: D102
    @property
    def heading(self) -> float: ...  # noqa: D102


class Motion(Protocol):
    """A motion by odometry; ``near`` is the distance from the end, in m or rad, that is enough."""

    near: float
    unit: str  # of what is left: m or rad
    speed: float  # the greatest, in this unit per s
    turning: float  # rad that are left of a turn on the spot within the motion; 0 without one

    def left(self, pose: Place) -> float:
        """Return how much is left; called for each pose."""

    def velocity(self, pose: Place, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""


class Progress:
    """Whether a motion gets on; a slow one may take the time that its smallest step needs."""

    def __init__(self, motion: Motion, patience: float, longest_wait: float, now_s: float) -> None:
        self._step = STEP if motion.unit == "m" else STEP_TURN
        self._patience = max(
            not_negative(patience, "patience"), START_S + self._step / motion.speed
        )
        self._longest_wait = longest_wait
        self._least = self._least_turning = math.inf
        self._progress_s = self._waited_s = now_s

    def restart(self, left: float, now_s: float) -> None:
        """Count progress from here on: the pose was corrected."""
        self._least, self._least_turning = left, math.inf
        self._progress_s = self._waited_s = now_s

    def ends(self, left: float, turning: float, now_s: float, *, waits: bool) -> bool:
        """Return whether nothing was achieved for too long; ``waits``: for the end of a stop."""
        if left < self._least - self._step:
            self.restart(left, now_s)
        elif 0 < turning < self._least_turning - STEP_TURN:
            self._least_turning = turning
            self._progress_s = self._waited_s = now_s
        elif waits and now_s - self._progress_s < self._longest_wait:
            self._waited_s = now_s
        return now_s - self._waited_s > self._patience


class Straight:
    """A distance in m along the heading at the start; negative is backward."""

    near = NEAR
    unit = "m"
    turning: float = 0.0

    def __init__(self, start: Place, distance: float, speed: float) -> None:
        self._start, self.speed = start, resolved(speed)
        self._distance, self._sign = abs(finite(distance)), math.copysign(1.0, distance)

    def left(self, pose: Place) -> float:
        """Return the distance that is left, m."""
        start = self._start
        way = (pose.x - start.x) * math.cos(start.heading)
        way += (pose.y - start.y) * math.sin(start.heading)
        return self._distance - self._sign * way

    def velocity(self, pose: Place, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""
        correction = KEEP_HEADING * math.remainder(self._start.heading - pose.heading, math.tau)
        bounded = max(-MAX_CORRECTION, min(MAX_CORRECTION, correction))
        return self._sign * slowing(left, self.speed, ACCELERATION, SLOWEST), bounded


class Turn:
    """An angle in rad on the spot, positive to the left; may be more than a whole turn."""

    near = NEAR_TURN
    unit = "rad"
    turning: float = 0.0

    def __init__(self, start: Place, angle: float, speed: float) -> None:
        self._angle, self._sign = abs(finite(angle)), math.copysign(1.0, angle)
        self.speed = resolved(speed, RESOLUTION_TURN, "rad/s")
        self._heading, self._turned = start.heading, 0.0

    def left(self, pose: Place) -> float:
        """Return the angle that is left, rad; call it for each pose."""
        self._turned += math.remainder(pose.heading - self._heading, math.tau)
        self._heading = pose.heading
        return self._angle - self._sign * self._turned

    def velocity(self, _: Place, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""
        return 0.0, self._sign * slowing(left, self.speed, TURNING, SLOWEST_TURN)


class Arc(Turn):
    """An angle in rad along a circle of this radius in m, positive to the left; forward."""

    near = NEAR
    unit = "m"

    def __init__(self, start: Place, radius: float, angle: float, speed: float) -> None:
        self._radius = positive(radius, "radius")
        self._slowest = RESOLUTION_TURN * self._radius  # m/s
        if speed < self._slowest:
            raise ValueError(
                f"an arc of {radius:g} m at {speed:g} m/s turns less than 0.1 deg/s, which the "
                "board cannot do"
            )
        super().__init__(start, angle, 1.0)
        self.speed = resolved(speed)  # m/s

    def left(self, pose: Place) -> float:
        """Return the distance that is left, m; call it for each pose."""
        return super().left(pose) * self._radius

    def velocity(self, _: Place, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""
        linear = slowing(left, self.speed, ACCELERATION, max(SLOWEST, self._slowest))
        return linear, self._sign * linear / self._radius


class Path:
    """Straight lines from the start through points, m; pure pursuit."""

    near = NEAR
    unit = "m"

    def __init__(
        self, start: Place, points: Iterable[tuple[float, float]], speed: float, turning: float
    ) -> None:
        self.speed, self._turning = resolved(speed), turning
        self._ahead = max(AHEAD, AHEAD_S * speed)
        corners = [(start.x, start.y), *((finite(x), finite(y)) for x, y in points)]
        self._lines = deque((a, b, math.dist(a, b)) for a, b in pairwise(corners) if a != b)
        self._after = sum(length for *_, length in islice(self._lines, 1, None))  # of the first
        self.turning: float = 0.0

    def left(self, pose: Place) -> float:
        """Return the distance that is left along the lines, m; call it for each pose."""
        while self._lines:
            left = self._left_of_line(pose)
            if left > 0:
                return left + self._after
            self._lines.popleft()  # passed
            self._after -= self._lines[0][2] if self._lines else 0.0
        return 0.0

    def _left_of_line(self, pose: Place) -> float:
        (ax, ay), (bx, by), length = self._lines[0]
        return ((bx - pose.x) * (bx - ax) + (by - pose.y) * (by - ay)) / length

    def _aim(self, pose: Place) -> tuple[float, float]:
        """Return the point ``ahead`` m along the lines, or the next sharp corner, or the end."""
        ahead = self._ahead + self._lines[0][2] - self._left_of_line(pose)
        before = None
        for (ax, ay), (bx, by), length in self._lines:
            direction = math.atan2(by - ay, bx - ax)
            if before is not None and abs(math.remainder(direction - before, math.tau)) > FACING:
                return ax, ay  # a point behind it would lie behind the vehicle
            if ahead < length:
                return ax + (bx - ax) * ahead / length, ay + (by - ay) * ahead / length
            ahead -= length
            before = direction
        return self._lines[-1][1]

    def velocity(self, pose: Place, left: float) -> tuple[float, float]:
        """Return the velocity to request: m/s, rad/s."""
        x, y = self._aim(pose)
        off = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.heading, math.tau)
        is_turning = abs(off) > (TURNED if self.turning else FACING)
        self.turning = abs(off) if is_turning else 0.0
        if is_turning:
            return 0.0, math.copysign(slowing(abs(off), self._turning, TURNING, SLOWEST_TURN), off)
        linear = slowing(left, self.speed * math.cos(off), ACCELERATION, SLOWEST)
        curvature = 2 * math.sin(off) / max(math.dist((x, y), (pose.x, pose.y)), self._ahead)
        return linear, linear * curvature


def slowing(left: float, speed: float, deceleration: float, slowest: float) -> float:
    """Return the speed at this distance from the end, never more than ``speed``."""
    return min(speed, max(slowest, math.sqrt(2 * deceleration * max(left, 0.0))))


def resolved(speed: float, resolution: float = RESOLUTION, unit: str = "m/s") -> float:
    """Return a speed as the board's commands can carry it, rounded down; raise ``ValueError``."""
    if positive(speed) < resolution:
        raise ValueError(f"speed must be at least {resolution:.2g} {unit}, not {speed}")
    return math.floor(speed / resolution + 1e-6) * resolution


def finite(number: float) -> float:
    """Return a number, of NumPy for example, as a float; raise ``ValueError`` or ``TypeError``."""
    if not math.fabs(number) <= MAX_NUMBER:
        raise ValueError(f"only finite numbers up to {MAX_NUMBER:g} are possible, not {number}")
    return float(number)


def positive(number: float, what: str = "speed") -> float:
    """Return a number likewise; raise ``ValueError`` for one that is not positive, too."""
    if not 0 < number < math.inf:
        hint = "; a negative distance drives backward" if what == "speed" else ""
        raise ValueError(f"{what} must be positive, not {number}{hint}")
    return finite(number)


def not_negative(number: float, what: str) -> float:
    """Return a number likewise; raise ``ValueError`` for a negative one, too."""
    if number < 0:
        raise ValueError(f"{what} must not be negative, as {number} is")
    return finite(number)


def check_word(word: str, known: Any) -> None:
    """Raise ``ValueError`` for a word that this ``Literal`` does not have."""
    if word not in get_args(known):
        raise ValueError(f"{word!r} is not one of {', '.join(get_args(known))}")
