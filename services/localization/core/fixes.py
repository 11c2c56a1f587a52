"""Fixes of one source: what they measure, whether they agree with each other. Pure."""

import math
from dataclasses import dataclass, field

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.pose import Covariance, Pose
from services.localization.config import FixSource
from services.localization.core.estimate import POSE, POSITION, Measured, Sample
from t2.messages import Fix, FixState, Phrase
from t2.words import render

AGREEING = 5  # fixes in a row that outweigh the pose
SIGMAS = 3.3  # 99.9 % of a normal distribution
FROZEN_M = 0.05  # that the vehicle drives while a frozen source repeats itself


class TakenFix(Struct, frozen=True):
    """A fix, and the odometry at which it was measured."""

    sample: Sample
    measured: Measured

    def has_left(self, before: "TakenFix") -> bool:
        """Return whether the vehicle has driven since another fix."""
        a, b = before.sample.pose, self.sample.pose
        return math.dist((a.x, a.y), (b.x, b.y)) > FROZEN_M

    def agrees(self, before: "TakenFix") -> bool:
        """Return whether the vehicle moved between two fixes as odometry says.

        Only distance and turn are compared: the heading of ``odom`` in the map may be wrong.
        """
        first, second, a, b = before.sample, self.sample, before.measured, self.measured
        dx, dy = second.pose.x - first.pose.x, second.pose.y - first.pose.y
        grown = second.covariance.combined(first.covariance.carried(dx, dy), -1.0)
        total = a.covariance.combined(b.covariance).combined(grown)
        apart = math.dist((a.pose.x, a.pose.y), (b.pose.x, b.pose.y))
        if abs(apart - math.hypot(dx, dy)) > SIGMAS * math.sqrt(max(0.0, total.xx + total.yy)):
            return False
        if min(a.values, b.values) < POSE:
            return True
        turned = b.pose.heading - a.pose.heading - (second.pose.heading - first.pose.heading)
        return abs(math.remainder(turned, math.tau)) <= SIGMAS * total.heading_sigma


@dataclass(slots=True)
class SourceState:
    """One source of fixes."""

    settings: FixSource
    received_ns: int | None = None
    used: int = 0
    refused: int = 0
    in_a_row: int = 0  # refused ones since the last one that was used
    reason: Phrase | None = None  # of the newest fix, if it was refused
    newest: TakenFix | None = None
    first: TakenFix | None = None  # the first one with the newest one's pose
    row: list[TakenFix] = field(default_factory=list)  # refused ones that agree with each other

    def fault(self, fix: TakenFix) -> Phrase | None:
        """Return what is wrong with a fix, whatever the pose is."""
        if self.newest is not None and fix.sample.seq <= self.newest.sample.seq:
            return Phrase("fix.repeated")
        self.newest = fix
        if self.first is None or fix.measured.pose != self.first.measured.pose:
            self.first = fix
        return Phrase("fix.frozen") if fix.has_left(self.first) else None

    def begin(self, *, anew: bool) -> None:
        """Begin with another pose in ``odom`` or in the map; with another ``odom``: ``anew``."""
        self.newest = None if anew else self.newest
        self.first = None
        self.row.clear()

    def count(self) -> None:
        """Count the newest fix by its ``reason``."""
        if self.reason is None:
            self.used += 1
            self.in_a_row = 0
            self.row.clear()
        else:
            self.refused += 1
            self.in_a_row += 1

    def agrees(self, fix: TakenFix) -> bool:
        """Note a fix that contradicts the pose; return whether enough in a row agree."""
        if self.row and not fix.agrees(self.row[-1]):
            self.row.clear()
        self.row = [*self.row, fix][-AGREEING:]
        return len(self.row) == AGREEING

    def message(self, name: str, now_ns: int) -> FixState:
        """Return what others see of this source."""
        phrases = (self.reason,) if self.reason else ()
        return FixState(
            source=name,
            age=None if self.received_ns is None else (now_ns - self.received_ns) / NS_PER_S,
            used=self.used,
            refused=self.refused,
            in_a_row=self.in_a_row,
            text=render(phrases),
            phrases=phrases,
        )


def measured_of(fix: Fix, sample: Sample, settings: FixSource) -> Measured | None:
    """Return what a fix measures that names a sample; None if its covariance is none.

    The variances of the settings are added. It was measured at any time until the next sample: the
    vehicle may have moved.
    """
    given, values = Covariance.of(fix.covariance), POSITION if fix.heading is None else POSE
    measured = Measured(Pose(fix.x, fix.y, fix.heading or 0.0), given, values)
    pairs = zip(given.rows(), fix.covariance, strict=True)
    is_symmetric = all(math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-12) for a, b in pairs)
    if not (is_symmetric and measured.is_possible):
        return None
    moved, turned = (each**2 / 12 for each in sample.step)  # variances of an interval
    least = settings.sigma**2 + moved, settings.heading_sigma**2 + turned
    covariance = given.combined(Covariance(least[0], 0.0, least[0], 0.0, 0.0, least[1]))
    return replace(measured, covariance=covariance)
