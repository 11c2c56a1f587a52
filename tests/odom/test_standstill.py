"""Covariance while the vehicle stands: bounded, whatever counters and velocities dither."""

import math
import random

import pytest

from common.freshness import NS_PER_S
from common.messages import Mileage
from services.odom.config import Odom
from services.odom.pose import ArcSegment
from services.odom.slip_detector import COUNTER_STEP_M, COUNTER_STEP_RAD
from services.odom.standstill import DISTANCE_WRAP_M, Standstill
from tests.odom.odom_fixture import OdomFixture, started

TICKS = 1000  # 20 s
WRAP_EDGE = DISTANCE_WRAP_M / 2 - 0.0005
ONE_STEP = (
    Odom().distance_noise ** 2 * COUNTER_STEP_M,
    Odom().turn_noise ** 2 * COUNTER_STEP_RAD + Odom().drift_noise ** 2 * COUNTER_STEP_M,
)


def variances(odom: OdomFixture) -> tuple[float, float]:
    """Return the variance of the position (along the vehicle) and of the heading."""
    rows = odom.odometry().pose_covariance
    return rows[0], rows[8]


def stand(odom: OdomFixture, ticks: int, velocity: float = 0.0, steps: int = 0) -> None:
    """Stand: velocities of this noise, twice per counter sample, counters within these steps."""
    dice = random.Random(1)
    board = odom.board
    distance, heading = board.distance, board.heading
    for _ in range(ticks):
        board.now_ns += NS_PER_S // 100
        board.linear = dice.uniform(-velocity, velocity)
        board.angular = dice.uniform(-velocity, velocity)
        odom.update(counters=False)
        board.now_ns += NS_PER_S // 100
        board.distance = distance + dice.randint(0, steps) * COUNTER_STEP_M
        board.heading = heading + dice.randint(0, steps) * COUNTER_STEP_RAD
        odom.update(velocity=False)
    board.linear = board.angular = 0.0


@pytest.mark.parametrize("distance", [0.0, 71.234, WRAP_EDGE])
@pytest.mark.parametrize("heading", [0.0, math.pi - COUNTER_STEP_RAD / 2])
@pytest.mark.parametrize(("velocity", "steps"), [(0.0, 0), (0.05, 0), (0.0, 1), (0.05, 1)])
def test_standing_adds_one_step_of_noise_however_long(
    distance: float, heading: float, velocity: float, steps: int
) -> None:
    odom = started(distance=distance, heading=heading)
    odom.drive(2)
    before = variances(odom)
    stand(odom, TICKS, velocity, steps)
    after = variances(odom)
    assert after[0] - before[0] < 1.5 * ONE_STEP[0]
    assert after[1] - before[1] < 1.5 * ONE_STEP[1]


@pytest.mark.parametrize("angular", [0.0, 0.4])
def test_creeping_adds_the_noise_of_its_whole_way(angular: float) -> None:
    """One counter step per sample: each sample is within the window of the one before."""
    odom = started(distance=0.0, heading=0.0)
    for _ in range(5000):
        odom.board.linear = 0.05 if angular == 0.0 else 0.0
        odom.board.angular = angular and math.radians(5.0)
        odom.drive(1)
    way, turned = (5.0, 0.0) if angular == 0.0 else (0.0, math.radians(500.0))
    noise = Odom().turn_noise ** 2 * turned + Odom().drift_noise ** 2 * way
    assert variances(odom)[1] - COUNTER_STEP_RAD**2 == pytest.approx(noise, rel=0.01)


def test_each_standstill_has_its_own_step() -> None:
    odom = started(distance=0.0, heading=0.0)
    grown = []
    for _ in range(3):
        before = variances(odom)[1]
        stand(odom, TICKS // 10, velocity=0.05)
        grown.append(variances(odom)[1] - before)
        odom.board.linear = 1.0
        odom.drive(50)
        odom.board.linear = 0.0
        odom.drive(1)
    assert all(0.9 * ONE_STEP[1] < each < 1.5 * ONE_STEP[1] for each in grown)


@pytest.mark.parametrize(
    ("linear", "angular", "time_s", "adds"),
    [
        (0.019, 0.0, 1.0, False),
        (0.021 + 1e-6, 0.0, 1.0, True),
        (0.0, 0.02 + COUNTER_STEP_RAD - 1e-6, 1.0, False),
        (COUNTER_STEP_M + 0.02, 0.0, 1.0, False),
        (0.0, COUNTER_STEP_RAD + 0.02, 1.0, False),
        (0.0, 0.02 + COUNTER_STEP_RAD + 1e-6, 1.0, True),
    ],
)
def test_forth_and_back_between_two_counter_samples_is_travel(
    linear: float, angular: float, time_s: float, adds: bool
) -> None:
    standstill = Standstill(Odom())
    standstill.update(mileage(1), [])
    segments = [ArcSegment(way, turn, time_s / 2, seen=True) for way, turn in
            ((linear / 2, angular / 2), (-linear / 2, -angular / 2))]  # fmt: skip
    standstill.update(mileage(2), segments)
    big = ArcSegment(1.0, 1.0, 1.0, seen=True)
    assert (standstill.noise_part(big) == big) is adds


@pytest.mark.parametrize(
    ("distance", "steps", "stands"),
    [(0.001, 0, True), (-0.001, 0, True), (0.002, 0, False), (-0.002, 0, False),
     (0.0, 1, True), (0.0, -1, True), (0.0, 2, False), (0.0, -2, False), (0.001, 2, False),
     (1.5 * COUNTER_STEP_M, 0, False), (0.0, 1.5, False), (DISTANCE_WRAP_M - 0.001, 3599, True)],
)  # fmt: skip
def test_the_counters_may_dither_by_one_step(distance: float, steps: float, stands: bool) -> None:
    standstill = Standstill(Odom())
    segment = ArcSegment(-0.5, -0.5, 0.1, seen=False)
    assert standstill.noise_part(segment) is segment
    standstill.update(mileage(1), [])
    assert standstill.noise_part(segment) is segment
    standstill.update(mileage(2, distance, steps * COUNTER_STEP_RAD), [])
    first, second = standstill.noise_part(segment), standstill.noise_part(segment)
    if stands:
        assert first == ArcSegment(COUNTER_STEP_M, COUNTER_STEP_RAD, 0.1, seen=False)
        assert second == ArcSegment(0.0, 0.0, 0.1, seen=False)
    else:
        assert first is second is segment


def test_where_the_counters_stand_does_not_matter() -> None:
    standstill = Standstill(Odom())
    for seq in (1, 2):
        standstill.update(mileage(seq, 7.0, 1.0), [])
    assert standstill.noise_part(ArcSegment(0.5, 0.5, 0.1, seen=True)).distance == COUNTER_STEP_M
    standstill.update(mileage(3, 7.002, 1.0), [])
    standstill.update(mileage(4, 7.002, 1.0), [])
    assert standstill.noise_part(ArcSegment(0.5, 0.5, 0.1, seen=True)).distance == COUNTER_STEP_M


def test_a_standstill_gives_its_step_in_parts() -> None:
    standstill = Standstill(Odom())
    for seq in (1, 2):
        standstill.update(mileage(seq), [])
    part = ArcSegment(-0.4 * COUNTER_STEP_M, 0.4 * COUNTER_STEP_RAD, 0.1, seen=True)
    given = [standstill.noise_part(part) for _ in range(4)]
    assert [each.distance / COUNTER_STEP_M for each in given] == pytest.approx([0.4, 0.4, 0.2, 0.0])
    assert [each.turn / COUNTER_STEP_RAD for each in given] == pytest.approx([0.4, 0.4, 0.2, 0.0])


def mileage(seq: int, distance: float = 0.0, heading: float = 0.0) -> Mileage:
    return Mileage(seq=seq, distance=distance, heading=heading, epoch=0)
