"""How doubt grows, number by number: by counters, by velocities, in gaps."""

import math

import pytest

from common.freshness import NS_PER_S
from common.messages import Mileage, Velocity
from services.odom.config import Odom
from services.odom.estimator import START, Estimator, Outcome
from services.odom.pose import ArcSegment, Covariance, Pose, PoseEstimate, ProcessNoise
from services.odom.slip_detector import COUNTER_STEP_M, COUNTER_STEP_RAD

ODOM = Odom(
    hold=0.1,
    distance_noise=0.011,
    turn_noise=0.023,
    drift_noise=0.017,
    velocity_noise=0.029,
    angular_noise=0.031,
    gap_noise=0.2,
    gap_turn_noise=0.3,
)
ZERO = PoseEstimate(Pose(0.0, 0.0, 0.0), START)


def counted(distance: float, turn: float, gap: bool = False) -> ProcessNoise:
    """Return the configured noise of a path measured by counters."""
    return ProcessNoise(
        0.011**2 * abs(distance),
        0.023**2 * abs(turn) + 0.017**2 * abs(distance),
        0.2**2 * abs(distance) if gap else 0.0,
    )


def followed(distance: float, turn: float, time_s: float, gap_s: float = 0.0) -> ProcessNoise:
    """Return the configured noise of a path measured by velocities only."""
    known = counted(distance, turn)
    return ProcessNoise(
        known.distance + 0.029**2 * time_s,
        known.turn + 0.031**2 * time_s + 0.3**2 * gap_s,
        0.2**2 * gap_s,
    )


def mileage(seq: int, distance: float, heading: float) -> Mileage:
    return Mileage(distance=distance, heading=heading, epoch=0, boot=1, seq=seq)


def close(estimate: PoseEstimate, expected: PoseEstimate) -> None:
    assert estimate.covariance.rows() == pytest.approx(expected.covariance.rows(), rel=1e-9)
    pose, other = estimate.pose, expected.pose
    assert (pose.x, pose.y, pose.heading) == pytest.approx((other.x, other.y, other.heading))


def test_the_start_is_as_certain_as_a_step_of_the_counters() -> None:
    step, turn = COUNTER_STEP_M**2, COUNTER_STEP_RAD**2
    assert Covariance(step, 0.0, step, 0.0, 0.0, turn) == START
    estimator = Estimator(ODOM)
    assert estimator._predicted == estimator._corrected == ZERO


@pytest.mark.parametrize(("distance", "turn"), [(0.5, 0.2), (-0.5, -0.2), (0.0, 0.2), (0.5, 0.0)])
@pytest.mark.parametrize(("time_s", "gap"), [(0.02, False), (0.1, False), (0.2, True)])
def test_by_counters_it_grows_with_the_way(
    distance: float, turn: float, time_s: float, gap: bool
) -> None:
    estimator = Estimator(ODOM)
    estimator.on_mileage(mileage(1, 7.0, 1.0), NS_PER_S)
    estimator.on_mileage(
        mileage(2, 7.0 + distance, 1.0 + turn), NS_PER_S + round(time_s * NS_PER_S)
    )
    expected = ZERO.moved(distance, turn, counted(distance, turn, gap))
    close(estimator._predicted, expected)
    close(estimator._corrected, expected)


@pytest.mark.parametrize(("linear", "angular"), [(0.5, 0.3), (-0.5, -0.3)])
def test_by_velocities_it_grows_with_the_time_too(linear: float, angular: float) -> None:
    estimator = Estimator(ODOM)
    estimator.on_velocity(Velocity(linear=linear, angular=angular), NS_PER_S)
    now_ns = NS_PER_S + NS_PER_S // 20
    odometry = estimator.estimate(now_ns)
    assert odometry is not None
    way = linear * 0.05, angular * 0.05
    expected = ZERO.moved(*way, followed(*way, 0.05))
    assert odometry.pose_covariance == pytest.approx(expected.covariance.rows(), rel=1e-9)
    assert (odometry.x, odometry.y) == pytest.approx((expected.pose.x, expected.pose.y))
    assert odometry.heading == pytest.approx(expected.pose.heading)
    assert (odometry.linear, odometry.angular) == (linear, angular)
    assert odometry.twist_covariance == (0.029**2, 0.0, 0.0, 0.031**2)
    estimator.on_velocity(Velocity(linear=0.0, angular=0.0), now_ns)
    close(estimator._predicted, expected)


@pytest.mark.parametrize("silence_s", [0.5, 1.3])
def test_in_a_gap_it_grows_once_the_velocity_no_longer_holds(silence_s: float) -> None:
    estimator = Estimator(ODOM)
    estimator.on_velocity(Velocity(linear=0.5, angular=0.3), NS_PER_S)
    estimator.on_velocity(Velocity(linear=0.0, angular=0.0), NS_PER_S + round(silence_s * NS_PER_S))
    held = ZERO.moved(0.05, 0.03, followed(0.05, 0.03, 0.1))
    unseen_s = silence_s - 0.1
    close(estimator._predicted, held.moved(0.0, 0.0, followed(0.0, 0.0, unseen_s, unseen_s - 0.1)))
    assert [segment.seen for segment in estimator._segments] == [True, False]


def test_a_long_leg_that_was_seen_is_no_gap() -> None:
    """Such are segments that were put together because there were too many."""
    seen = ArcSegment(1.0, 0.2, 0.5, seen=True)
    assert Estimator(ODOM)._counter_noise(seen) == counted(1.0, 0.2)


def test_before_any_velocity_all_time_is_unseen() -> None:
    estimator = Estimator(ODOM)
    estimator.on_mileage(mileage(1, 0.0, 0.0), NS_PER_S)
    estimator.on_velocity(Velocity(linear=0.0, angular=0.0), 2 * NS_PER_S)
    close(estimator._predicted, ZERO.moved(0.0, 0.0, followed(0.0, 0.0, 1.0, 0.9)))


def test_counters_that_start_anew_keep_the_doubt_of_the_velocities() -> None:
    estimator = Estimator(ODOM)
    estimator.on_mileage(mileage(1, 0.0, 0.0), NS_PER_S)
    estimator.on_velocity(Velocity(linear=1.0, angular=0.0), NS_PER_S)
    anew = Mileage(distance=0.0, heading=0.0, epoch=1, boot=1, seq=2)
    assert estimator.on_mileage(anew, NS_PER_S + NS_PER_S // 20) is Outcome.BOARD_RESTARTED
    close(estimator._corrected, ZERO.moved(0.05, 0.0, followed(0.05, 0.0, 0.05)))
    assert estimator._segments == []


def test_a_pose_that_is_set_carries_the_way_since_the_counters_along() -> None:
    estimator = Estimator(ODOM)
    estimator.on_mileage(mileage(1, 0.0, 0.0), NS_PER_S)
    estimator.on_velocity(Velocity(linear=1.0, angular=0.5), NS_PER_S)
    estimator.place(Pose(3.0, -2.0, 4.0), NS_PER_S + NS_PER_S // 10)
    lead, anchor = estimator._predicted, estimator._corrected
    assert lead.covariance == anchor.covariance == START
    assert lead.pose == Pose(3.0, -2.0, 4.0 - math.tau)
    assert math.hypot(lead.pose.x - anchor.pose.x, lead.pose.y - anchor.pose.y) < 0.1
    back = anchor.pose.moved(0.1, 0.05)
    assert (back.x, back.y, back.heading) == pytest.approx((3.0, -2.0, 4.0 - math.tau))
    for epoch in (2, 3):
        estimator.place(Pose(0.0, 0.0, 0.0), NS_PER_S + NS_PER_S // 10)
        assert estimator.epoch == epoch
