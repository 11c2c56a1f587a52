"""Steps between two counter samples: wraparounds and invalid steps."""

import math

import pytest

from common.messages import Mileage, Velocity
from services.odom.config import Odom
from services.odom.estimator import Estimator, Outcome, check_continuity, step
from services.odom.pose import ArcSegment
from services.odom.standstill import DISTANCE_WRAP_M

UP = math.inf


def mileage(
    distance: float = 0.0, heading: float = 0.0, *, epoch: int = 0, boot: int = 1, seq: int = 1
) -> Mileage:
    return Mileage(distance=distance, heading=heading, epoch=epoch, boot=boot, seq=seq)


def seen(turn: float = 0.0) -> ArcSegment:
    return ArcSegment(0.0, turn, 1.0, seen=True)


@pytest.mark.parametrize(
    ("before", "after", "integrated", "turn"),
    [
        (1.0, 1.25, 0.0, 0.25),
        (1.0, 0.75, 0.0, -0.25),
        (3.0, -3.0, 0.0, math.tau - 6.0),
        (0.0, 0.5, 6.0, 0.5 + math.tau),
        (0.0, 0.5, -6.0, 0.5 - math.tau),
        (0.0, 0.5, 3.0, 0.5),
        (0.0, 0.0, 13.0, 2 * math.tau),
    ],
)
def test_a_turn_is_the_one_nearest_to_what_the_velocities_saw(
    before: float, after: float, integrated: float, turn: float
) -> None:
    steps = step(mileage(heading=before), mileage(heading=after), seen(integrated))
    assert steps == pytest.approx((0.0, turn))


@pytest.mark.parametrize(
    ("before", "after", "distance"),
    [
        (1.0, 3.5, 2.5),
        (3.5, 1.0, -2.5),
        (2147483.0, -2147483.0, DISTANCE_WRAP_M - 2 * 2147483.0),
        (-2147483.0, 2147483.0, 2 * 2147483.0 - DISTANCE_WRAP_M),
    ],
)
def test_a_distance_goes_on_over_the_wrap(before: float, after: float, distance: float) -> None:
    assert DISTANCE_WRAP_M == 4294967.296
    assert step(mileage(before), mileage(after), seen()) == pytest.approx((distance, 0.0))


@pytest.mark.parametrize(
    ("before", "after", "outcome"),
    [
        (mileage(), mileage(seq=2), Outcome.USED),
        (mileage(), mileage(boot=2), Outcome.BRIDGE_RESTARTED),
        (mileage(epoch=3), mileage(boot=2), Outcome.BRIDGE_RESTARTED),
        (mileage(), mileage(epoch=1), Outcome.BOARD_RESTARTED),
        (mileage(epoch=1), mileage(epoch=0), Outcome.BOARD_RESTARTED),
    ],
)
def test_what_goes_on_and_what_begins(before: Mileage, after: Mileage, outcome: Outcome) -> None:
    assert check_continuity(before, after, 0.0, 1.0) is outcome


@pytest.mark.parametrize(
    ("distance", "time_s", "outcome"),
    [
        (1.0, 0.0, Outcome.USED),
        (-1.0, 0.0, Outcome.USED),
        (math.nextafter(1.0, UP), 0.0, Outcome.JUMPED),
        (math.nextafter(-1.0, -UP), 0.0, Outcome.JUMPED),
        (11.0, 2.0, Outcome.USED),
        (11.01, 2.0, Outcome.JUMPED),
    ],
)
def test_a_jump_is_farther_than_any_vehicle_drives(
    distance: float, time_s: float, outcome: Outcome
) -> None:
    assert check_continuity(mileage(), mileage(seq=2), distance, time_s) is outcome


@pytest.mark.parametrize(
    ("linear", "angular", "outcome"),
    [
        (5.0, 10.0, Outcome.USED),
        (-5.0, -10.0, Outcome.USED),
        (math.nextafter(5.0, UP), 0.0, Outcome.IMPLAUSIBLE),
        (math.nextafter(-5.0, -UP), 0.0, Outcome.IMPLAUSIBLE),
        (0.0, math.nextafter(10.0, UP), Outcome.IMPLAUSIBLE),
        (0.0, math.nextafter(-10.0, -UP), Outcome.IMPLAUSIBLE),
    ],
)
def test_the_fastest_plausible_velocity(linear: float, angular: float, outcome: Outcome) -> None:
    velocity = Velocity(linear=linear, angular=angular)
    assert Estimator(Odom()).on_velocity(velocity, 0) is outcome


@pytest.mark.parametrize(
    ("boot", "seq", "outcome"),
    [
        (1, 4, Outcome.LATE),
        (1, 5, Outcome.LATE),
        (1, 6, Outcome.USED),
        (2, 1, Outcome.BRIDGE_RESTARTED),
    ],
)
def test_seq_rises_within_its_boot(boot: int, seq: int, outcome: Outcome) -> None:
    estimator = Estimator(Odom())
    assert estimator.on_mileage(mileage(seq=5), 0) is Outcome.FIRST
    assert estimator.on_mileage(mileage(boot=boot, seq=seq), 1) is outcome
