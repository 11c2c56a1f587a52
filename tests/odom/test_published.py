"""What is published, when, and with how much doubt; and what is refused."""

import math

import pytest
from hypothesis import given

from common.freshness import NS_PER_S
from common.messages import Mileage, Velocity
from services.odom.config import Odom
from services.odom.estimator import Estimator, Outcome
from tests.odom.drive import (
    EXACT,
    TICK_NS,
    Board,
    Listener,
    driving,
    minors,
    parts,
    speeds,
    started,
    turnings,
)


def test_nothing_is_said_before_anything_is_heard() -> None:
    assert Estimator(Odom()).estimate(NS_PER_S) is None


def test_one_counter_sample_makes_no_twist() -> None:
    listener = Listener(Board())
    listener.hear(velocity=False)
    assert listener.estimator.estimate(listener.board.now_ns) is None


def test_the_last_velocity_holds_and_then_there_is_silence() -> None:
    listener = driving()
    hold_ns = round(Odom().hold * NS_PER_S)
    assert listener.odometry(hold_ns).linear == 0.8
    assert listener.estimator.estimate(listener.board.now_ns + hold_ns + 1) is None


def test_counters_alone_are_told_once_each_with_the_twist_that_they_make() -> None:
    listener = driving()
    listener.drive(20, velocity=False)
    odometry = listener.odometry()
    assert (odometry.linear, odometry.angular) == pytest.approx((0.8, 0.3))
    assert odometry.residual == pytest.approx(0.0, abs=1e-6)
    assert listener.estimator.estimate(listener.board.now_ns) is None
    listener.drive(1, velocity=False)
    assert listener.off() == EXACT


def test_wheels_that_turn_without_counts_slip() -> None:
    listener = driving()
    assert listener.odometry().slip is False
    listener.board.linear = 0.0
    for _ in range(20):
        listener.board.tick()
        listener.hear(velocity=False)
        listener.estimator.on_velocity(Velocity(linear=1.0, angular=0.0), listener.board.now_ns)
    odometry = listener.odometry()
    assert odometry.slip is True
    assert odometry.residual == pytest.approx(-0.4, abs=0.03)


def test_velocities_alone_are_followed_with_growing_doubt() -> None:
    listener = Listener(Board(linear=0.5))
    listener.hear(counters=False)
    listener.drive(10, counters=False)
    early = listener.odometry()
    listener.drive(100, counters=False)
    late = listener.odometry()
    assert (early.x, late.x) == pytest.approx((0.1, 1.1))
    assert late.pose_covariance[0] > early.pose_covariance[0]
    assert late.residual is None


def test_doubt_grows_while_a_gap_lasts_and_counters_that_stand_still_end_it() -> None:
    listener = started()
    before = listener.odometry().pose_covariance
    listener.board.tick(100)
    listener.hear(counters=False)
    during = listener.odometry().pose_covariance
    listener.board.tick()
    listener.hear()
    after = listener.odometry().pose_covariance
    for at in (0, 4, 8):
        assert during[at] > before[at]
        assert after[at] == pytest.approx(before[at])


def test_twist_covariance_is_diagonal_and_positive() -> None:
    linear, cross, cross_too, angular = driving().odometry().twist_covariance
    assert cross == cross_too == 0.0
    assert linear > 0
    assert angular > 0


@given(parts)
def test_covariance_is_symmetric_and_semidefinite(
    way: list[tuple[float, float, list[tuple[bool, bool]]]],
) -> None:
    listener = started()
    for linear, angular, heard in way:
        listener.board.linear, listener.board.angular = linear, angular
        for counters, velocity in heard:
            listener.board.tick(2)
            listener.hear(counters=counters, velocity=velocity)
    listener.hear()
    rows = listener.odometry().pose_covariance
    assert (rows[1], rows[2], rows[5]) == (rows[3], rows[6], rows[7])
    assert min(minors(rows)) >= -1e-12


@given(speeds.filter(lambda speed: abs(speed) > 0.1), turnings)
def test_covariance_grows_with_the_way(linear: float, angular: float) -> None:
    listener = started()
    listener.board.linear, listener.board.angular = linear, angular
    areas = []
    for _ in range(4):
        listener.drive(25)
        rows = listener.odometry().pose_covariance
        areas.append((rows[8], minors(rows)[-1]))
    assert areas == sorted(areas)
    assert len(set(areas)) == 4


def test_covariance_grows_with_a_gap_and_does_not_depend_on_the_rate() -> None:
    often, rarely, gap = driving(), driving(), driving()
    often.drive(100)
    for _ in range(50):
        rarely.board.tick(2)
        rarely.hear()
    gap.board.tick(100)
    gap.hear()
    areas = [listener.odometry().pose_covariance[0] for listener in (often, rarely, gap)]
    assert areas[1] == pytest.approx(areas[0], rel=0.01)
    assert areas[2] > 2 * areas[0]


@pytest.mark.parametrize("gap", [1, 25, 500])
def test_standing_still_does_not_add_doubt(gap: int) -> None:
    listener = started()
    before = listener.odometry().pose_covariance
    for _ in range(500 // gap):
        listener.board.tick(gap)
        listener.hear()
    assert listener.odometry().pose_covariance == pytest.approx(before)


BAD = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("bad", BAD)
def test_what_is_no_number_is_refused(bad: float) -> None:
    listener = driving()
    estimator, now_ns = listener.estimator, listener.board.now_ns
    before = listener.odometry()
    for linear, angular in ((bad, 0.0), (0.0, bad)):
        outcome = estimator.on_velocity(Velocity(linear=linear, angular=angular), now_ns)
        assert outcome is Outcome.NO_NUMBER
    for distance, heading in ((bad, 0.0), (0.0, bad)):
        mileage = Mileage(distance=distance, heading=heading, epoch=0, boot=1, seq=10**6)
        assert estimator.on_mileage(mileage, now_ns) is Outcome.NO_NUMBER
    assert listener.odometry() == before


@pytest.mark.parametrize(("linear", "angular"), [(5.1, 0.0), (-1e300, 0.0), (0.0, 10.1)])
def test_an_implausible_velocity_is_refused(linear: float, angular: float) -> None:
    listener = driving()
    velocity = Velocity(linear=linear, angular=angular)
    outcome = listener.estimator.on_velocity(velocity, listener.board.now_ns)
    assert outcome is Outcome.IMPLAUSIBLE
    assert listener.odometry().linear == 0.8


def test_old_counters_are_late() -> None:
    listener = driving()
    old = listener.board.mileage()
    listener.drive(5)
    assert listener.estimator.on_mileage(old, listener.board.now_ns) is Outcome.LATE
    assert listener.off() == EXACT


def test_a_sample_from_before_the_last_one_does_not_move_time_back() -> None:
    listener = driving()
    listener.estimator.on_velocity(listener.board.velocity(), listener.board.now_ns - TICK_NS)
    assert listener.off() == EXACT
