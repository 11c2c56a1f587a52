"""Displacement from the place of a standstill."""

import math
import random

import pytest

from common.freshness import NS_PER_S, Latest
from common.motion import STANDING_MPS, STANDING_RADPS, STILL, Twist
from common.standstill import (
    AWAY_M,
    AWAY_RAD,
    DRIFT_RADPS,
    GRACE_NS,
    Displacement,
    comparable,
    stopping_ns,
)
from t2.messages import Mileage

TICK_NS = NS_PER_S // 50
TICK_S = TICK_NS / NS_PER_S


class Vehicle:
    """Feeds velocities and counters at every tick."""

    def __init__(self) -> None:
        self.now_ns = 10 * NS_PER_S
        self.displacement = Displacement()
        self.measure(0.0)
        self.count()

    def measure(self, linear: float | None, angular: float = 0.0, ticks: int = 1) -> Displacement:
        for _ in range(ticks):
            self.now_ns += TICK_NS
            twist = None if linear is None else Latest(Twist(linear, angular), self.now_ns)
            self.displacement = self.displacement.with_velocity(twist)
        return self.displacement

    def count(self, distance: float = 0.0, heading: float = 0.0, epoch: int = 0) -> Displacement:
        self.now_ns += TICK_NS
        mileage = Mileage(
            distance=distance, heading=math.remainder(heading, math.tau), epoch=epoch, boot=1
        )
        self.displacement = self.displacement.with_mileage(Latest(mileage, self.now_ns))
        return self.displacement


@pytest.mark.parametrize(
    ("integrated", "counted", "left"),
    [
        (Twist(AWAY_M, -AWAY_RAD), Twist(-AWAY_M, AWAY_RAD), False),
        (Twist(AWAY_M + 1e-9), STILL, True),
        (Twist(0.0, -AWAY_RAD - 1e-9), STILL, True),
        (STILL, Twist(-AWAY_M - 1e-9), True),
        (STILL, Twist(0.0, AWAY_RAD + 1e-9), True),
    ],
)
def test_bounds_of_the_place(integrated: Twist, counted: Twist, left: bool) -> None:
    displacement = Displacement(integrated=integrated, counted=counted)
    assert displacement.has_left is left
    assert not displacement.from_here().has_left


@pytest.mark.parametrize(
    ("linear", "angular", "way"),
    [
        (STANDING_MPS, 0.0, Twist(STANDING_MPS * TICK_S)),
        (-STANDING_MPS * 0.99, STANDING_RADPS * 0.99, STILL),
        (0.0, -STANDING_RADPS, Twist(0.0, -STANDING_RADPS * TICK_S)),
        (0.5, 0.3, Twist(0.5 * TICK_S, 0.3 * TICK_S)),
    ],
)
def test_velocities_from_the_threshold_on_are_integrated(
    linear: float, angular: float, way: Twist
) -> None:
    vehicle = Vehicle()
    assert vehicle.measure(linear, angular).integrated == STILL  # a single one does not count
    assert vehicle.measure(linear, angular).integrated == way


def test_the_smaller_of_two_velocities_counts() -> None:
    vehicle = Vehicle()
    for linear, angular, steady in [
        (5.0, 10.0, STILL),
        (0.4, -0.2, Twist(0.4, 0.0)),
        (0.3, -0.5, Twist(0.3, -0.2)),
        (-0.3, -0.1, Twist(0.0, -0.1)),
    ]:
        assert vehicle.measure(linear, angular).steady == steady


def test_an_unknown_velocity_interrupts_the_integral() -> None:
    vehicle = Vehicle()
    assert vehicle.measure(None).steady is None
    assert not vehicle.displacement.is_standing
    assert vehicle.measure(5.0).integrated == STILL
    assert vehicle.displacement.steady == Twist(5.0)
    assert vehicle.measure(0.0).is_standing


def test_each_velocity_counts_once_and_a_gap_at_most_a_tenth_of_a_second() -> None:
    vehicle = Vehicle()
    vehicle.measure(0.5)
    vehicle.now_ns += NS_PER_S
    once = vehicle.measure(0.5)
    assert once.integrated == Twist(0.5 * 0.1)
    assert once.with_velocity(once.velocity) is once


def test_the_integral_leaks() -> None:
    vehicle = Vehicle()
    vehicle.measure(0.5, -0.5, ticks=2)
    began = vehicle.displacement.integrated
    left = vehicle.measure(0.0, ticks=1).integrated
    assert left == began.scaled(1 - TICK_S / 5)


def test_noise_and_bias_do_not_add_up() -> None:
    vehicle, noise = Vehicle(), random.Random(1)
    for _ in range(50 * 120):
        vehicle.measure(noise.gauss(0.005, 0.03), noise.gauss(0.01, 0.06))
        assert not vehicle.count(noise.choice((0.0, 0.001, -0.001)), noise.gauss(0, 0.003)).has_left


def test_counters_add_up_across_half_a_turn() -> None:
    vehicle = Vehicle()
    vehicle.count(0.0, math.pi - 0.02)
    vehicle.displacement = vehicle.displacement.from_here()
    turned = vehicle.count(-0.03, math.pi + 0.02).counted
    assert (turned.linear, turned.angular) == pytest.approx((-0.03, 0.04 - DRIFT_RADPS * TICK_S))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_drift_of_the_heading_is_no_motion(sign: int) -> None:
    vehicle = Vehicle()
    drift = sign * DRIFT_RADPS * TICK_S
    assert abs(vehicle.count(0.0, 0.99 * drift).counted.angular) == 0
    assert vehicle.count(0.0, 3 * drift).counted.angular == pytest.approx(1.01 * drift)


def test_a_slow_creep_adds_up() -> None:
    vehicle = Vehicle()
    for millimetres in range(51):
        assert not vehicle.count(millimetres / 1000 * 0.99).has_left
    assert vehicle.count(0.051).has_left


def test_counters_that_began_anew_are_not_compared() -> None:
    vehicle = Vehicle()
    vehicle.count(0.04)
    anew = vehicle.count(7.0, epoch=1)
    assert anew.counted.linear == pytest.approx(0.04)
    assert vehicle.count(7.02, epoch=1).has_left


def test_a_reading_counts_once() -> None:
    vehicle = Vehicle()
    once = vehicle.count(0.03)
    assert once.with_mileage(once.mileage) is once
    assert once.with_mileage(None) is once


@pytest.mark.parametrize(("boot", "epoch", "same"), [(1, 2, True), (1, 3, False), (2, 2, False)])
def test_comparable_counters(boot: int, epoch: int, same: bool) -> None:
    before = Mileage(distance=0.0, heading=0.0, epoch=2, boot=1)
    assert comparable(before, Mileage(distance=9.0, heading=0.0, epoch=epoch, boot=boot)) is same


@pytest.mark.parametrize(
    ("velocity", "stop_s"),
    [(Twist(), 0.0), (Twist(-0.3), 0.5), (Twist(0.3, -1.0), 2.0), (Twist(1.5, 1.0), 2.5)],
)
def test_the_longer_of_both_axes_counts_for_a_stop(velocity: Twist, stop_s: float) -> None:
    assert stopping_ns(velocity, 0.6, 0.5) == round(stop_s * NS_PER_S) + GRACE_NS
