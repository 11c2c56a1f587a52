"""Restarts of board, bridge and host, and a pose set by an operator."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.odom.estimator import Outcome
from services.odom.pose import Pose
from tests.odom.odom_fixture import (
    EXACT,
    TICK_NS,
    Board,
    OdomFixture,
    apart,
    driving,
    pose_of,
    speeds,
    started,
    turnings,
)


def restart_board(board: Board) -> Outcome:
    board.distance = board.heading = 0.0
    board.epoch += 1
    return Outcome.BOARD_RESTARTED


def restart_bridge(board: Board) -> Outcome:
    board.boot, board.seq, board.epoch = board.boot + 1, 0, 0
    return Outcome.BRIDGE_RESTARTED


def restart_both(board: Board) -> Outcome:
    board.distance = board.heading = 0.0
    return restart_bridge(board)


def restart_unnoticed(board: Board) -> Outcome:
    board.distance = 0.0
    return Outcome.JUMPED


RESTARTS = [restart_board, restart_bridge, restart_both, restart_unnoticed]


@pytest.mark.parametrize("restart", RESTARTS)
@pytest.mark.parametrize("pause", [0, 3, 300])
def test_a_restart_does_not_move_the_pose(restart: object, pause: int) -> None:
    assert callable(restart)
    odom = driving()
    expected = restart(odom.board)
    odom.board.now_ns += pause * TICK_NS
    before = odom.estimator.estimate(odom.board.now_ns)
    lead = odom.estimator._predicted
    assert odom.update(velocity=False) is expected
    after = odom.estimator.estimate(odom.board.now_ns)
    if before is not None and after is not None:
        assert apart(pose_of(before), pose_of(after)) == EXACT
    held = lead.pose.moved(0.8 * min(pause * 0.02, 0.1), 0.3 * min(pause * 0.02, 0.1))
    assert apart(odom.estimator._predicted.pose, held) == EXACT


@pytest.mark.parametrize("restart", RESTARTS)
def test_counting_goes_on_after_a_restart(restart: object) -> None:
    assert callable(restart)
    odom = driving()
    restart(odom.board)
    odom.update()
    odom.drive(100)
    assert odom.off() == EXACT
    assert odom.odometry().epoch == 0


def test_the_host_starts_at_zero_wherever_the_counters_stand() -> None:
    odom = started(distance=123.0, heading=-3.0)
    assert odom.pose() == Pose(0.0, 0.0, 0.0)


def test_uncertainty_grows_over_a_restart() -> None:
    odom, other = driving(), driving()
    for each in (odom, other):
        each.board.now_ns += NS_PER_S
    restart_board(odom.board)
    odom.update()
    other.update()
    assert odom.odometry().pose_covariance[8] > other.odometry().pose_covariance[8]


poses = st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))


@given(speeds, turnings, st.integers(0, 3), poses)
def test_a_pose_set_while_driving_is_followed_exactly(
    linear: float, angular: float, ticks: int, pose: Pose
) -> None:
    odom = started()
    odom.board.linear, odom.board.angular = linear, angular
    odom.drive(20)
    odom.board.tick(ticks)
    odom.estimator.place(pose, odom.board.now_ns)
    odom.board.truth = pose
    assert odom.off() == EXACT
    odom.drive(20)
    assert odom.off() == EXACT
    assert odom.odometry().epoch == 1


def test_a_pose_that_is_set_is_certain_again() -> None:
    odom = driving()
    before = odom.odometry().pose_covariance
    odom.estimator.place(Pose(0.0, 0.0, 7.0), odom.board.now_ns)
    after = odom.odometry()
    assert after.pose_covariance[0] < before[0]
    assert after.heading == pytest.approx(7.0 - math.tau)


def test_a_pose_can_be_set_before_anything_is_heard() -> None:
    odom = OdomFixture(Board())
    odom.estimator.place(Pose(1.0, 2.0, 0.5), odom.board.now_ns)
    odom.update()
    assert odom.pose() == Pose(1.0, 2.0, 0.5)
