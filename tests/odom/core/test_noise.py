"""Process noise number by number, and the standstill that adds one counter step of it."""

import math
import random

import pytest

from common.freshness import NS_PER_S
from services.odom.config import Odom
from services.odom.core.noise import COUNTER_STEP_M, COUNTER_STEP_RAD, NoiseModel
from services.odom.core.pose import ArcSegment, ProcessNoise
from t2.messages import Mileage
from tests.odom.core.odom_fixture import OdomFixture, started

ODOM = Odom(
    distance_noise=0.011,
    turn_noise=0.023,
    drift_noise=0.017,
    velocity_noise=0.029,
    angular_noise=0.031,
)
ONE_STEP = (
    Odom().distance_noise ** 2 * COUNTER_STEP_M,
    Odom().turn_noise ** 2 * COUNTER_STEP_RAD + Odom().drift_noise ** 2 * COUNTER_STEP_M,
)
ARC = ArcSegment(-0.5, -0.5, 0.1, seen=True)


def mileage(distance: float = 0.0, heading: float = 0.0) -> Mileage:
    return Mileage(distance=distance, heading=heading, epoch=0)


def stands(model: NoiseModel) -> bool:
    """Return whether a long arc adds the noise of one counter step at most."""
    noise = model.counted(ARC)
    return (noise.distance, noise.turn) <= ONE_STEP


def stands_after(distance: float, heading: float, *segments: ArcSegment) -> bool:
    """Return whether these counters, after zeros, and velocities are a standstill."""
    model = NoiseModel(Odom())
    assert not stands(model)
    model.update(mileage(), [])
    assert not stands(model)
    model.update(mileage(distance, heading), segments)
    return stands(model)


@pytest.mark.parametrize(("distance", "turn"), [(0.5, 0.2), (-0.5, -0.2), (0.0, 0.2), (0.5, 0.0)])
@pytest.mark.parametrize(
    ("time_s", "seen", "gap_s"), [(0.1, False, 0.0), (0.5, True, 0.0), (0.5, False, 0.4)]
)
def test_noise_by_distance_turn_time_and_gap(
    distance: float, turn: float, time_s: float, seen: bool, gap_s: float
) -> None:
    model, segment = NoiseModel(ODOM), ArcSegment(distance, turn, time_s, seen)
    length = 0.011**2 * abs(distance)
    turned = 0.023**2 * abs(turn) + 0.017**2 * abs(distance)
    gap_m = abs(distance) if gap_s else 0.0
    counted, by_velocity = model.counted(segment), model.extrapolated(segment)
    assert_close(counted, ProcessNoise(length, turned, 0.2**2 * gap_m))
    assert_close(
        by_velocity,
        ProcessNoise(
            length + 0.029**2 * time_s,
            turned + 0.031**2 * time_s + 0.3**2 * gap_s,
            0.2**2 * gap_s,
        ),
    )


def assert_close(noise: ProcessNoise, expected: ProcessNoise) -> None:
    values = noise.distance, noise.turn, noise.place
    assert values == pytest.approx((expected.distance, expected.turn, expected.place))


@pytest.mark.parametrize(
    ("distance", "steps", "expected"),
    [(0.0, 0, True), (0.001, 0, True), (-0.001, 0, True), (0.002, 0, False), (-0.002, 0, False),
     (0.0, 1, True), (0.0, -1, True), (0.0, 2, False), (0.0, -2, False), (0.001, 2, False),
     (1.5 * COUNTER_STEP_M, 0, False), (0.0, 1.5, False), (0.001, 3599, True)],
)  # fmt: skip
def test_counters_may_dither_by_one_step(distance: float, steps: float, expected: bool) -> None:
    assert stands_after(distance, steps * COUNTER_STEP_RAD) is expected


def test_the_step_of_a_standstill_may_come_in_parts() -> None:
    model = NoiseModel(Odom())
    for _ in range(2):
        model.update(mileage(), [])
    part = ArcSegment(0.6 * COUNTER_STEP_M, 0.6 * COUNTER_STEP_RAD, 0.1, seen=True)
    for share in (0.6, 0.4, 0.0):
        assert_close(model.counted(part), ProcessNoise(share * ONE_STEP[0], share * ONE_STEP[1], 0))


@pytest.mark.parametrize(
    ("distance", "turn", "expected"),
    [
        (COUNTER_STEP_M + 0.02, 0.0, True),
        (COUNTER_STEP_M + 0.02 + 1e-6, 0.0, False),
        (0.0, COUNTER_STEP_RAD + 0.02, True),
        (0.0, COUNTER_STEP_RAD + 0.02 + 1e-6, False),
    ],
)
def test_motion_back_and_forth_between_two_counter_samples_is_travel(
    distance: float, turn: float, expected: bool
) -> None:
    segments = [ArcSegment(sign * distance / 2, sign * turn / 2, 0.5, True) for sign in (1, -1)]
    assert stands_after(0.0, 0.0, *segments) is expected


def test_the_place_of_a_standstill_moves_with_the_vehicle() -> None:
    model, seen = NoiseModel(Odom()), []
    for distance in (7.0, 7.0, 7.002, 7.003, 7.004, 7.004, 7.0035):
        model.update(mileage(distance, 1.0), [])
        seen.append(stands(model))
    assert seen == [False, True, False, True, False, True, True]


# --- through the estimator ------------------------------------------------------------------


def variances(odom: OdomFixture) -> tuple[float, float]:
    """Return the variance of the position (along the vehicle) and of the heading."""
    rows = odom.odometry().pose_covariance
    return rows[0], rows[8]


@pytest.mark.parametrize("heading", [0.0, math.pi - COUNTER_STEP_RAD / 2])
@pytest.mark.parametrize(("velocity", "steps"), [(0.05, 0), (0.05, 1)])
def test_standing_adds_one_step_of_noise_however_long(
    heading: float, velocity: float, steps: int
) -> None:
    """Velocities of this noise, twice per counter sample, counters within these steps."""
    odom = started(distance=71.234, heading=heading)
    odom.drive(2)
    before, dice, board = variances(odom), random.Random(1), odom.board
    distance = board.distance
    for _ in range(500):
        board.now_ns += NS_PER_S // 100
        board.linear, board.angular = (dice.uniform(-velocity, velocity) for _ in range(2))
        odom.update(counters=False)
        board.now_ns += NS_PER_S // 100
        board.distance = distance + dice.randint(0, steps) * COUNTER_STEP_M
        board.heading = heading + dice.randint(0, steps) * COUNTER_STEP_RAD
        odom.update(velocity=False)
    after = variances(odom)
    assert after[0] - before[0] < 1.5 * ONE_STEP[0]
    assert after[1] - before[1] < 1.5 * ONE_STEP[1]


@pytest.mark.parametrize(("linear", "angular"), [(0.05, 0.0), (0.0, math.radians(5.0))])
def test_creeping_adds_the_noise_of_its_whole_way(linear: float, angular: float) -> None:
    """One counter step per sample: each sample is within the window of the one before."""
    odom = started(linear=linear, angular=angular)
    odom.drive(5000)
    noise = Odom().turn_noise ** 2 * angular * 100 + Odom().drift_noise ** 2 * linear * 100
    assert variances(odom)[1] - COUNTER_STEP_RAD**2 == pytest.approx(noise, rel=0.02)
