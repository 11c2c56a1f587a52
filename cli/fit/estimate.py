"""A parameter of the vehicle from its observations: mean, interval of 95 %, and bounds. Pure.

The interval is that of Student's t for the mean, widened by half of the resolution of one
observation. A bound is what 95 % of all further observations keep, with a confidence of 95 %
(a one-sided tolerance limit of a normal distribution, NIST/SEMATECH e-Handbook of Statistical
Methods, 7.2.6.3), never better than the worst observation, and half of the resolution worse.
"""

from math import inf, sqrt
from statistics import mean, stdev

from msgspec import Struct

# Two-sided 95 % quantiles of Student's t by degrees of freedom, from 1.
STUDENT = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
           2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086)  # fmt: skip
ONE_SIDED = 1.645  # 95 % quantile of the normal distribution
LEAST = 5  # observations of a bound


class Estimate(Struct, frozen=True, kw_only=True):
    """Observations of a parameter, in its unit."""

    name: str
    unit: str
    values: tuple[float, ...]
    resolution: float = 0.0  # of one observation
    setting: str = ""  # path of the setting that it concerns

    @property
    def mean(self) -> float:
        """Mean of the observations."""
        return mean(self.values)

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of 95 % for the mean; infinite with a single observation."""
        number = len(self.values)
        if number < 2:
            return -inf, inf
        half = student(number - 1) * stdev(self.values) / sqrt(number) + self.resolution / 2
        return self.mean - half, self.mean + half

    @property
    def upper_bound(self) -> float:
        """Value that further observations exceed in 5 % of the cases at most."""
        return max(*self.values, self.mean + self._margin()) + self.resolution / 2

    @property
    def lower_bound(self) -> float:
        """Value that further observations fall below in 5 % of the cases at most."""
        return min(*self.values, self.mean - self._margin()) - self.resolution / 2

    def _margin(self) -> float:
        if len(self.values) < LEAST:
            return inf
        return tolerance(len(self.values)) * stdev(self.values)


def student(freedom: int) -> float:
    """Return the two-sided 95 % quantile of Student's t."""
    return STUDENT[freedom - 1] if freedom <= len(STUDENT) else 1.96 + 2.5 / freedom


def tolerance(number: int) -> float:
    """Return the one-sided tolerance factor of so many observations, at least ``LEAST``."""
    square = ONE_SIDED**2
    a = 1 - square / (2 * (number - 1))
    b = square - square / number
    return (ONE_SIDED + sqrt(square - a * b)) / a
