"""Intervals and bounds, against published tables and random samples."""

import random
from math import inf

import pytest

from cli.fit.estimate import LEAST, Estimate, student, tolerance


def estimate(*values: float, resolution: float = 0.0) -> Estimate:
    return Estimate(name="one", unit="m", values=values, resolution=resolution)


@pytest.mark.parametrize(
    ("freedom", "quantile"), [(1, 12.706), (20, 2.086), (21, 2.080), (40, 2.021), (120, 1.980)]
)
def test_student(freedom: int, quantile: float) -> None:
    assert student(freedom) == pytest.approx(quantile, abs=0.003)


@pytest.mark.parametrize(
    ("number", "factor"), [(5, 4.203), (6, 3.708), (10, 2.911), (20, 2.396), (50, 2.065)]
)
def test_the_tolerance_factor(number: int, factor: float) -> None:
    """The published ones, of the noncentral t distribution."""
    assert tolerance(number) == pytest.approx(factor, rel=0.02)


def test_an_interval() -> None:
    assert estimate(1.0).interval == (-inf, inf)
    assert estimate(1.0, 3.0).interval == pytest.approx((2 - 12.706, 2 + 12.706))
    assert estimate(2.0, 2.0, resolution=0.2).interval == pytest.approx((1.9, 2.1))


def test_a_bound_needs_observations_and_is_never_better_than_the_worst() -> None:
    few = estimate(*[1.0] * (LEAST - 1))
    assert (few.lower_bound, few.upper_bound) == (-inf, inf)
    assert estimate(*[1.0] * LEAST).lower_bound == 1.0
    skewed = estimate(*[1.0] * 99, 0.2)
    assert skewed.lower_bound == 0.2
    assert skewed.upper_bound > 1.0


def test_intervals_and_bounds_hold_as_often_as_they_state() -> None:
    chance = random.Random(5)
    inside = below = 0
    for _ in range(2000):
        one = estimate(*(chance.gauss(0.6, 0.05) for _ in range(6)))
        low, high = one.interval
        inside += low <= 0.6 <= high
        below += one.lower_bound <= 0.6 - 1.645 * 0.05  # the 5 % quantile
    assert inside / 2000 == pytest.approx(0.95, abs=0.02)
    assert below / 2000 >= 0.93
