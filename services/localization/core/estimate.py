"""Pose in the map by odometry and fixes: an extended Kalman filter over x, y and heading.

The state is a ``Transform``: where the origin of ``odom`` is in ``map``, and how much less certain
the pose is than odometry says (``excess``; negative where fixes have made it more certain). So the
process noise is that of odometry, without a second model: for an odometry sample with pose o and
covariance C,

    pose = transform * o
    covariance = R (carried(excess) + C) R'

where R turns ``odom`` into ``map``, and ``carried`` moves a covariance from the place where it was
taken to o, as odometry does. A fix corrects pose and covariance at its own sample, and from there
``excess`` is taken anew: that is why a late fix needs no prediction of the past.
"""

import math

from msgspec import Struct
from msgspec.structs import replace

from common.pose import Covariance, Pose

POSITION, POSE = 2, 3  # values of a fix: x and y, or x, y and heading

# Chi-square quantiles of 99.9 %, by the number of values.
GATE = {POSITION: 13.816, POSE: 16.266}

ROUNDING = 1e-12  # m^2, rad^2

Matrix = list[list[float]]


class Measured(Struct, frozen=True):
    """A fix: pose and covariance in ``map``; the heading counts only with ``POSE``."""

    pose: Pose
    covariance: Covariance
    values: int = POSE

    @property
    def is_possible(self) -> bool:
        """Whether the covariance is positive definite."""
        matrix = self.matrix()
        minors = [matrix[0][0], determinant([row[:2] for row in matrix[:2]])]
        minors += [determinant(matrix)] if self.values == POSE else []
        return all(each > 0 for each in minors)

    def matrix(self) -> Matrix:
        """Return the covariance of what was measured."""
        return square(self.covariance, self.values)


class Located(Struct, frozen=True):
    """Pose and covariance in ``map``."""

    pose: Pose
    covariance: Covariance

    def difference(self, fix: Measured) -> tuple[list[float], Matrix]:
        """Return fix minus pose, and its covariance."""
        heading = math.remainder(fix.pose.heading - self.pose.heading, math.tau)
        values = [fix.pose.x - self.pose.x, fix.pose.y - self.pose.y, heading][: fix.values]
        own = square(self.covariance, fix.values)
        return values, [
            [a + b for a, b in zip(*rows, strict=True)]
            for rows in zip(own, fix.matrix(), strict=True)
        ]

    def distance(self, fix: Measured) -> float:
        """Return the squared distance of a fix in standard deviations (Mahalanobis)."""
        difference, covariance = self.difference(fix)
        weighted = product(inverse(covariance), [[each] for each in difference])
        return sum(a * b[0] for a, b in zip(difference, weighted, strict=True))

    def corrected(self, fix: Measured) -> "Located":
        """Return pose and covariance after a fix."""
        difference, covariance = self.difference(fix)
        own = square(self.covariance, 3)
        observed = [row[: fix.values] for row in own]
        gain = product(observed, inverse(covariance))
        x, y, heading = (sum(a * b for a, b in zip(row, difference, strict=True)) for row in gain)
        less = product(gain, own[: fix.values])
        rows = [a - b for pair in zip(own, less, strict=True) for a, b in zip(*pair, strict=True)]
        pose = Pose(
            self.pose.x + x,
            self.pose.y + y,
            math.remainder(self.pose.heading + heading, math.tau),
        )
        return Located(pose, Covariance.of(rows))


class Sample(Struct, frozen=True):
    """Pose and covariance of one odometry message, in ``odom``."""

    seq: int
    pose: Pose
    covariance: Covariance
    received_ns: int
    step: tuple[float, float] = (0.0, 0.0)  # m and rad until the next message

    def after(self, before: "Sample", covariance: Covariance) -> "Sample":
        """Return this sample with the covariance of all steps, from the one before on.

        ``covariance`` is what odometry said of that one. Odometry becomes more certain when
        counters replace a path that only velocities had shown. The step from one path to the other
        is as uncertain as the first was: certainty about the past does not grow by it.
        """
        dx, dy = self.pose.x - before.pose.x, self.pose.y - before.pose.y
        step = self.covariance.combined(covariance.carried(dx, dy), -1.0)
        if min(step.xx, step.yy, step.hh) < -ROUNDING:
            step = Covariance(abs(step.xx), 0.0, abs(step.yy), 0.0, 0.0, abs(step.hh))
        return replace(self, covariance=before.covariance.carried(dx, dy).combined(step))

    def halfway(self) -> "Sample":
        """Return where the vehicle was in the middle until the next message."""
        distance, turn = self.step
        pose = self.pose.moved(distance / 2, turn / 2)
        covariance = self.covariance.carried(pose.x - self.pose.x, pose.y - self.pose.y)
        return replace(self, pose=pose, covariance=covariance)


class Transform(Struct, frozen=True):
    """The origin of ``odom`` in ``map``, with the excess of covariance at a place in ``odom``."""

    origin: Pose
    excess: Covariance  # in the axes of ``odom``
    taken: Pose

    @classmethod
    def of(cls, located: Located, sample: Sample) -> "Transform":
        """Return the transform for a known pose at a sample."""
        origin = located.pose.then(sample.pose.inverse())
        own = located.covariance.rotated(-origin.heading)
        return cls(origin, own.combined(sample.covariance, -1.0), sample.pose)

    def at(self, sample: Sample) -> Located:
        """Return the pose in the map at a sample."""
        dx, dy = sample.pose.x - self.taken.x, sample.pose.y - self.taken.y
        own = self.excess.carried(dx, dy).combined(sample.covariance)
        return Located(self.origin.then(sample.pose), own.rotated(self.origin.heading))

    def corrected(self, sample: Sample, fix: Measured) -> "Transform":
        """Return the transform after a fix that was measured at a sample."""
        return Transform.of(self.at(sample).corrected(fix), sample)


def square(covariance: Covariance, size: int) -> Matrix:
    """Return the upper left part of a covariance."""
    rows = covariance.rows()
    return [list(rows[3 * i : 3 * i + size]) for i in range(size)]


def product(a: Matrix, b: Matrix) -> Matrix:
    """Return the product of two matrices."""
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(row, each, strict=True)) for each in columns] for row in a]


def determinant(matrix: Matrix) -> float:
    """Return the determinant of a matrix of 2 or 3 rows."""
    if len(matrix) == 2:
        return matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0]
    return sum(matrix[0][i] * cofactor(matrix, 0, i) for i in range(3))


def cofactor(matrix: Matrix, row: int, column: int) -> float:
    """Return a cofactor of a matrix of 2 or 3 rows."""
    rest = [each[:column] + each[column + 1 :] for i, each in enumerate(matrix) if i != row]
    minor = rest[0][0] if len(rest) == 1 else determinant(rest)
    return minor if (row + column) % 2 == 0 else -minor


def inverse(matrix: Matrix) -> Matrix:
    """Return the inverse of a symmetric, positive definite matrix of 2 or 3 rows."""
    size, whole = range(len(matrix)), determinant(matrix)
    return [[cofactor(matrix, i, j) / whole for j in size] for i in size]
