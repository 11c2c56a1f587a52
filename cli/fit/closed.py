"""Noises of odometry from closed drives: recordings that end where they began. Pure.

There the pose that odometry claims is its error, in the frame of the first pose. Its covariance is
that of the shipped estimator over the recorded velocities and counters, from the start pose on.
The normalized error squared (NEES) of x, y and heading has the mean 3 if the covariance is right.

All deviations grow by one factor k, as a closed drive does not tell them apart: n drives have
the sum of NEES k² · chi²(3 n), so its 5 % quantile gives the upper bound of 95 % for k. A mark on
the ground is only as good as the parking on it: that error counts as odometry's, the safe side.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from statistics import mean
from typing import Any

from msgspec import Struct
from msgspec.structs import asdict

from cli.fit.check import counted
from cli.fit.estimate import LEAST, ONE_SIDED
from cli.fit.streams import Streams, between
from common.freshness import NS_PER_S
from common.motion import Twist
from common.pose import Pose
from services.odom.config import Odom
from services.odom.core.estimator import Estimator
from services.odom.core.noise import HOLD_S
from t2.messages import Message, Mileage, Odometry, Velocity

DEGREES = 3  # of freedom: x, y, heading
SHORTEST_M = 5.0  # of a drive: errors of the mark must be small beside its noise
LONGEST_GAP_S = 2 * HOLD_S  # from there on the noise of a gap is in the covariance
RESTING = 10  # velocities at the begin and at the end, whose mean must be a standstill
GROSS_M, GROSS_RAD = 1.0, math.radians(30)
# Between the published pose and that of the estimator: parts of a period, and lost messages.
UNLIKE_M, UNLIKE_SHARE, UNLIKE_RAD = 0.02, 0.005, 0.02
NOISES = ("distance_noise", "turn_noise", "drift_noise")  # of counted arcs
STEP = 1000  # a proposal is rounded up to 1 / STEP
GREATEST = 10.0  # that the settings allow

Matrix = Sequence[Sequence[float]]


class ClosedDrive(Struct, frozen=True, kw_only=True):
    """One recording that ended where it began."""

    name: str
    host: int
    begin_ns: int
    end_ns: int
    way: float  # m, counted
    error: Pose  # of odometry at the end
    nees: float

    @property
    def is_gross(self) -> bool:
        """Whether the error is rather the operator's."""
        apart_m = math.hypot(self.error.x, self.error.y)
        return apart_m >= GROSS_M or abs(self.error.heading) >= GROSS_RAD


class Closed(Struct, frozen=True):
    """All closed drives, and what follows from them."""

    drives: Sequence[ClosedDrive]
    today: Odom

    @property
    def gross(self) -> list[ClosedDrive]:
        """The drives from which nothing may follow."""
        return [drive for drive in self.drives if drive.is_gross]

    @property
    def factor(self) -> float:
        """By which the standard deviations must grow."""
        return math.sqrt(mean(drive.nees for drive in self.drives) / DEGREES)

    @property
    def bound(self) -> float:
        """Upper bound of the factor, 95 %."""
        total = sum(drive.nees for drive in self.drives)
        return math.sqrt(total / lower_quantile(DEGREES * len(self.drives)))

    @property
    def proposals(self) -> dict[str, float]:
        """Noises by the settings' path; fewer than ``LEAST`` drives make none smaller."""
        if self.gross or not self.drives:
            return {}
        scale = self.bound if len(self.drives) >= LEAST else max(1.0, self.bound)
        today = {name: value for name, value in asdict(self.today).items() if name in NOISES}
        found = {
            name: math.ceil(value * scale * STEP - 1e-6) / STEP for name, value in today.items()
        }
        if scale == 1.0 or max(found.values()) > GREATEST:
            return {}
        return {f"odom.{name}": value for name, value in found.items()}

    def lines(self) -> Iterator[str]:
        """Yield the drives and what follows as text; nothing without a drive."""
        if not self.drives:
            return
        yield from map(_line, self.drives)
        number = len(self.drives)
        yield (
            f"Noises of odometry: their factor is {self.factor:.2f}, at most {self.bound:.2f} "
            f"(95 %), by {number} closed {'drive' if number == 1 else 'drives'}."
        )
        for path, value in self.proposals.items():
            today = getattr(self.today, path.removeprefix("odom."))
            yield f"{path}: today {today:g}, proposal {value:g}."
        if self.gross:
            yield "No noise is proposed with a gross error: leave that recording out, or repeat it."
        elif not self.proposals:
            yield "No noise is proposed: today's are kept."
        if number < LEAST:
            yield f"{LEAST - number} more closed drives are missing until a noise may be smaller."


def closed_drive(name: str, streams: Streams, settings: Odom) -> ClosedDrive:
    """Return error and NEES of a recording; raise ``ValueError`` if it shows neither."""
    for problem in _problems(streams):
        raise ValueError(problem)
    pose, covariance = _estimated(streams, settings)
    error = _relative(streams.odometries[0], streams.odometries[-1])
    way, _ = counted(streams)
    apart_m = math.hypot(error.x - pose.x, error.y - pose.y)
    apart_rad = abs(math.remainder(error.heading - pose.heading, math.tau))
    if apart_m > UNLIKE_M + UNLIKE_SHARE * way or apart_rad > UNLIKE_RAD:
        raise ValueError(
            f"odometry's pose is {apart_m:.2f} m and {math.degrees(apart_rad):.1f} degrees from "
            "that of the recorded counters: odometry had lost messages, or the recording has"
        )
    first, last = streams.mileages[0], streams.mileages[-1]
    return ClosedDrive(
        name=name, host=first.host, begin_ns=first.mono_ns, end_ns=last.mono_ns, way=way,
        error=error, nees=nees(covariance, (error.x, error.y, error.heading)),
    )  # fmt: skip


def check_distinct(drives: Sequence[ClosedDrive]) -> None:
    """Raise ``ValueError`` for two recordings of one time: a drive counts once."""
    in_time = sorted(drives, key=lambda drive: (drive.host, drive.begin_ns))
    for before, after in pairwise(in_time):
        if before.host == after.host and after.begin_ns < before.end_ns:
            raise ValueError(f"{before.name} and {after.name} are of the same time: name one")


def nees(covariance: Matrix, error: Sequence[float]) -> float:
    """Return error' · covariance^-1 · error, by the Cholesky factor of the covariance."""
    factor: list[list[float]] = []
    whitened: list[float] = []
    for row, value in zip(covariance, error, strict=True):
        mine: list[float] = []
        for column, before in enumerate(factor):
            rest = sum(a * b for a, b in zip(mine, before, strict=False))
            mine.append((row[column] - rest) / before[column])
        diagonal = math.sqrt(row[len(mine)] - sum(a * a for a in mine))
        rest = sum(a * b for a, b in zip(mine, whitened, strict=True))
        whitened.append((value - rest) / diagonal)
        factor.append([*mine, diagonal])
    return sum(a * a for a in whitened)


def lower_quantile(freedom: int) -> float:
    """Return the 5 % quantile of chi-square: Wilson and Hilferty, PNAS 17 (1931), 684.

    It is too low by 7 % for 3 degrees of freedom and by 0.1 % for 15, the safe side.
    """
    part = 2 / (9 * freedom)
    return float(freedom * (1 - part - ONE_SIDED * math.sqrt(part)) ** 3)


def _problems(streams: Streams) -> Iterator[str]:
    """Yield why a recording shows no error of odometry."""
    poses, counters = streams.odometries, streams.mileages
    if not poses:
        yield "has no tel/odom/odometry"
    yield from _restarts(streams)
    for stream, messages in (("velocities", streams.velocities), ("counters", counters)):
        gap_s = max(((b.mono_ns - a.mono_ns) / NS_PER_S for a, b in pairwise(messages)), default=0)
        if gap_s > LONGEST_GAP_S:
            yield f"{stream} are missing for {gap_s:.2f} s"
    for where, velocities in (
        ("begin", streams.velocities[:RESTING]),
        ("end", streams.velocities[-RESTING:]),
    ):
        moving = Twist(mean(v.linear for v in velocities), mean(v.angular for v in velocities))
        if not moving.is_standing:
            yield f"the vehicle moves at its {where}, so that is no mark"
    if (way := counted(streams)[0]) < SHORTEST_M:
        yield f"it drives {way:.1f} m only: drive {SHORTEST_M:g} m or more"


def _restarts(streams: Streams) -> Iterator[str]:
    """Yield what broke the pose off."""
    poses, counters = streams.odometries, streams.mileages
    changes: tuple[tuple[str, Sequence[Message], Callable[[Any], int]], ...] = (
        ("odometry restarted", poses, lambda pose: pose.boot),
        ("odometry's pose was set", poses, lambda pose: pose.epoch),
        ("the bridge restarted", counters, lambda mileage: mileage.boot),
        ("the board restarted", counters, lambda mileage: mileage.epoch),
    )
    for what, messages, of in changes:
        for before, now in pairwise(messages):
            if of(before) != of(now):
                yield f"{what} after {(now.mono_ns - messages[0].mono_ns) / NS_PER_S:.0f} s"


def _estimated(streams: Streams, settings: Odom) -> tuple[Pose, Matrix]:
    """Return pose and covariance at the last counters, by the shipped estimator from the first."""
    estimator = Estimator(settings)
    begin_ns, end_ns = streams.mileages[0].mono_ns, streams.mileages[-1].mono_ns
    velocities = between(streams.velocities, begin_ns, end_ns)
    inputs: list[Velocity | Mileage] = [*streams.mileages, *velocities]
    for each in sorted(inputs, key=lambda one: one.mono_ns):
        if isinstance(each, Velocity):
            estimator.on_velocity(each, each.mono_ns)
        else:
            estimator.on_mileage(each, each.mono_ns)
    found = estimator.estimate(end_ns)
    if found is None:
        raise ValueError("has no velocity at its last counters")
    rows = found.pose_covariance
    pose = Pose(found.x, found.y, found.heading)
    return pose, [rows[0:3], rows[3:6], rows[6:9]]


def _relative(first: Odometry, last: Odometry) -> Pose:
    """Return the last pose in the frame of the first one."""
    x, y = last.x - first.x, last.y - first.y
    cos, sin = math.cos(first.heading), math.sin(first.heading)
    heading = math.remainder(last.heading - first.heading, math.tau)
    return Pose(x * cos + y * sin, y * cos - x * sin, heading)


def _line(drive: ClosedDrive) -> str:
    error = drive.error
    text = (
        f"Closed drive {drive.name}: {drive.way:.1f} m; by odometry it ended {abs(error.x):.3f} m "
        f"{'ahead' if error.x >= 0 else 'behind'}, {abs(error.y):.3f} m to the "
        f"{'left' if error.y >= 0 else 'right'}, turned {abs(math.degrees(error.heading)):.1f} "
        f"degrees to the {'left' if error.heading >= 0 else 'right'}; NEES {drive.nees:.1f}, "
        f"{DEGREES} on average if the noises are right."
    )
    return text + " A GROSS ERROR: did it really end at the mark?" * drive.is_gross
