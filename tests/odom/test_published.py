"""Published odometry, its covariance, and refused samples."""

import math

import pytest
from hypothesis import given

from common.freshness import NS_PER_S
from common.messages import Mileage, Velocity
from services.odom.config import Odom
from services.odom.estimator import Estimator, Outcome
from tests.odom.odom_fixture import (
    EXACT,
    TICK_NS,
    Board,
    OdomFixture,
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
    odom = OdomFixture(Board())
    odom.update(velocity=False)
    assert odom.estimator.estimate(odom.board.now_ns) is None


def test_the_last_velocity_holds_and_then_there_is_silence() -> None:
    odom = driving()
    hold_ns = round(Odom().hold * NS_PER_S)
    assert odom.odometry(hold_ns).linear == 0.8
    assert odom.estimator.estimate(odom.board.now_ns + hold_ns + 1) is None


def test_counters_alone_are_told_once_each_with_the_twist_that_they_make() -> None:
    odom = driving()
    odom.drive(20, velocity=False)
    odometry = odom.odometry()
    assert (odometry.linear, odometry.angular) == pytest.approx((0.8, 0.3))
    assert odometry.residual == pytest.approx(0.0, abs=1e-6)
    assert odom.estimator.estimate(odom.board.now_ns) is None
    odom.drive(1, velocity=False)
    assert odom.off() == EXACT


def test_wheels_that_turn_without_counts_slip() -> None:
    odom = driving()
    assert odom.odometry().slip is False
    odom.board.linear = 0.0
    for _ in range(20):
        odom.board.tick()
        odom.update(velocity=False)
        odom.estimator.on_velocity(Velocity(linear=1.0, angular=0.0), odom.board.now_ns)
    odometry = odom.odometry()
    assert odometry.slip is True
    assert odometry.residual == pytest.approx(-0.4, abs=0.03)


def test_velocities_alone_are_followed_with_growing_doubt() -> None:
    odom = OdomFixture(Board(linear=0.5))
    odom.update(counters=False)
    odom.drive(10, counters=False)
    early = odom.odometry()
    odom.drive(100, counters=False)
    late = odom.odometry()
    assert (early.x, late.x) == pytest.approx((0.1, 1.1))
    assert late.pose_covariance[0] > early.pose_covariance[0]
    assert late.residual is None


def test_doubt_grows_while_a_gap_lasts_and_counters_that_stand_still_end_it() -> None:
    odom = started()
    before = odom.odometry().pose_covariance
    odom.board.tick(100)
    odom.update(counters=False)
    during = odom.odometry().pose_covariance
    odom.board.tick()
    odom.update()
    after = odom.odometry().pose_covariance
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
    odom = started()
    for linear, angular, received in way:
        odom.board.linear, odom.board.angular = linear, angular
        for counters, velocity in received:
            odom.board.tick(2)
            odom.update(counters=counters, velocity=velocity)
    odom.update()
    rows = odom.odometry().pose_covariance
    assert (rows[1], rows[2], rows[5]) == (rows[3], rows[6], rows[7])
    assert min(minors(rows)) >= -1e-12


@given(speeds.filter(lambda speed: abs(speed) > 0.1), turnings)
def test_covariance_grows_with_the_way(linear: float, angular: float) -> None:
    odom = started()
    odom.board.linear, odom.board.angular = linear, angular
    areas = []
    for _ in range(4):
        odom.drive(25)
        rows = odom.odometry().pose_covariance
        areas.append((rows[8], minors(rows)[-1]))
    assert areas == sorted(areas)
    assert len(set(areas)) == 4


def test_covariance_grows_with_a_gap_and_does_not_depend_on_the_rate() -> None:
    often, rarely, gap = driving(), driving(), driving()
    often.drive(100)
    for _ in range(50):
        rarely.board.tick(2)
        rarely.update()
    gap.board.tick(100)
    gap.update()
    areas = [odom.odometry().pose_covariance[0] for odom in (often, rarely, gap)]
    assert areas[1] == pytest.approx(areas[0], rel=0.01)
    assert areas[2] > 2 * areas[0]


@pytest.mark.parametrize("gap", [1, 25, 500])
def test_standing_still_does_not_add_doubt(gap: int) -> None:
    odom = started()
    before = odom.odometry().pose_covariance
    for _ in range(500 // gap):
        odom.board.tick(gap)
        odom.update()
    assert odom.odometry().pose_covariance == pytest.approx(before)


BAD = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("bad", BAD)
def test_what_is_no_number_is_refused(bad: float) -> None:
    odom = driving()
    estimator, now_ns = odom.estimator, odom.board.now_ns
    before = odom.odometry()
    for linear, angular in ((bad, 0.0), (0.0, bad)):
        outcome = estimator.on_velocity(Velocity(linear=linear, angular=angular), now_ns)
        assert outcome is Outcome.NOT_FINITE
    for distance, heading in ((bad, 0.0), (0.0, bad)):
        mileage = Mileage(distance=distance, heading=heading, epoch=0, boot=1, seq=10**6)
        assert estimator.on_mileage(mileage, now_ns) is Outcome.NOT_FINITE
    assert odom.odometry() == before


@pytest.mark.parametrize(("linear", "angular"), [(5.1, 0.0), (-1e300, 0.0), (0.0, 10.1)])
def test_an_implausible_velocity_is_refused(linear: float, angular: float) -> None:
    odom = driving()
    velocity = Velocity(linear=linear, angular=angular)
    outcome = odom.estimator.on_velocity(velocity, odom.board.now_ns)
    assert outcome is Outcome.IMPLAUSIBLE
    assert odom.odometry().linear == 0.8


def test_old_counters_are_late() -> None:
    odom = driving()
    old = odom.board.mileage()
    odom.drive(5)
    assert odom.estimator.on_mileage(old, odom.board.now_ns) is Outcome.LATE
    assert odom.off() == EXACT


def test_a_sample_from_before_the_last_one_does_not_move_time_back() -> None:
    odom = driving()
    odom.estimator.on_velocity(odom.board.velocity(), odom.board.now_ns - TICK_NS)
    assert odom.off() == EXACT
