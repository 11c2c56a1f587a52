"""The estimate against the truth: arcs, gaps and wraps."""

import math

from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.messages import Velocity
from services.odom.estimator import SEGMENTS_MAX
from services.odom.pose import Pose
from services.odom.standstill import DISTANCE_WRAP_M
from tests.odom.odom_fixture import (
    EXACT,
    TICK_NS,
    apart,
    parts,
    speeds,
    started,
    turnings,
)

# --- arcs -----------------------------------------------------------------------------------


@given(speeds, turnings, st.integers(1, 60))
def test_an_arc_is_exact_by_counters_alone(linear: float, angular: float, ticks: int) -> None:
    odom = started()
    odom.board.linear, odom.board.angular = linear, angular
    odom.drive(ticks, velocity=False)
    lead = odom.estimator._predicted.pose
    assert apart(lead, odom.board.truth) == EXACT


@given(speeds, turnings, st.integers(1, 4))
def test_velocities_carry_the_pose_to_now(linear: float, angular: float, ticks: int) -> None:
    odom = started()
    odom.board.linear, odom.board.angular = linear, angular
    odom.update(counters=False)
    odom.board.tick(ticks)
    assert odom.off() == EXACT


def test_asking_does_not_change_the_answer() -> None:
    odom = started()
    odom.board.linear = 1.0
    odom.drive(3)
    assert odom.odometry(10_000_000) == odom.odometry(10_000_000)


# --- gaps -----------------------------------------------------------------------------------


@given(parts, st.booleans())
def test_after_lost_frames_distance_and_heading_are_those_of_the_counters(
    way: list[tuple[float, float, list[tuple[bool, bool]]]], coarse: bool
) -> None:
    """For any loss, the heading equals the counters' and the distance is at most theirs."""
    odom = started()
    odom.board.coarse = coarse
    for linear, angular, received in way:
        odom.board.linear, odom.board.angular = linear, angular
        for counters, velocity in received:
            odom.board.tick()
            odom.update(counters=counters, velocity=velocity)
    odom.board.tick()
    odom.update()
    pose, board = odom.pose(), odom.board
    assert apart(pose, board.truth)[1] <= math.radians(0.05) + 1e-9
    fastest = sum(abs(linear) * len(received) for linear, _, received in way) + 1.5
    assert math.hypot(pose.x, pose.y) <= fastest * TICK_NS / NS_PER_S + 0.001 * (len(way) + 1)


@given(st.lists(st.tuples(speeds, turnings, st.booleans()), max_size=40))
def test_counters_alone_make_arcs_of_what_was_not_lost(
    way: list[tuple[float, float, bool]],
) -> None:
    odom = started()
    expected, distance, turn = Pose(0.0, 0.0, 0.0), 0.0, 0.0
    for linear, angular, received in way:
        odom.board.linear, odom.board.angular = linear, angular
        odom.board.tick()
        distance += linear * TICK_NS / NS_PER_S
        turn += angular * TICK_NS / NS_PER_S
        if received:
            odom.update(velocity=False)
            expected, distance, turn = expected.moved(distance, turn), 0.0, 0.0
    assert apart(odom.estimator._predicted.pose, expected) == EXACT


@given(parts)
def test_lost_counters_leave_no_error_while_velocities_come(
    way: list[tuple[float, float, list[tuple[bool, bool]]]],
) -> None:
    """A gap in the counters costs nothing: the velocities know the shape of the way."""
    odom = started()
    for linear, angular, received in way:
        odom.board.linear, odom.board.angular = linear, angular
        odom.update(counters=False)
        for counters, _ in received:
            odom.board.tick()
            odom.update(counters=counters)
    assert odom.off() == EXACT


@given(speeds, turnings, st.lists(st.tuples(st.booleans(), st.booleans()), max_size=60))
def test_any_loss_on_a_constant_arc_leaves_no_error(
    linear: float, angular: float, received: list[tuple[bool, bool]]
) -> None:
    odom = started()
    odom.board.linear, odom.board.angular = linear, angular
    odom.update(counters=False)
    for counters, velocity in received:
        odom.board.tick()
        odom.update(counters=counters, velocity=velocity)
    odom.board.tick()
    odom.update()
    assert odom.off() == EXACT


@given(speeds, turnings, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_wrong_velocities_do_not_stay(
    linear: float, angular: float, wrong_linear: float, wrong_angular: float
) -> None:
    """Velocities that are off by a constant are taken back by the counters, every one of them."""
    odom = started()
    board = odom.board
    board.linear, board.angular = linear, angular
    wrong = Velocity(linear=linear + wrong_linear, angular=angular + wrong_angular)
    odom.estimator.on_velocity(wrong, board.now_ns)
    for tick in range(60):
        board.tick()
        odom.update(counters=tick % 7 == 3, velocity=False)
        odom.estimator.on_velocity(wrong, board.now_ns)
    board.tick()
    odom.update(velocity=False)
    assert apart(odom.estimator._predicted.pose, board.truth) == EXACT


def test_counters_in_their_own_steps_stay_within_them() -> None:
    odom = started()
    odom.board.coarse = True
    odom.board.linear, odom.board.angular = 0.7, 0.4
    odom.drive(1000)
    distance, turn = odom.off()
    assert turn <= math.radians(0.1)
    assert distance < 0.03  # 14 m of way in steps of 1 mm and 0.1 deg


def test_a_long_gap_of_the_counters_is_bounded_and_exact() -> None:
    odom = started()
    odom.board.linear, odom.board.angular = 1.0, 0.8
    odom.update(counters=False)
    odom.drive(SEGMENTS_MAX, counters=False)
    assert len(odom.estimator._segments) == SEGMENTS_MAX == 512
    odom.drive(100, counters=False)
    assert len(odom.estimator._segments) <= SEGMENTS_MAX
    odom.board.tick()
    odom.update()
    assert odom.off() == EXACT


# --- wraps ----------------------------------------------------------------------------------


@given(st.sampled_from([1.0, -1.0]), st.floats(0.0, 2 * math.pi))
def test_heading_wraps_either_way(direction: float, offset: float) -> None:
    odom = started(heading=offset)
    odom.board.linear, odom.board.angular = 0.5, 4.0 * direction
    odom.drive(100)  # 8 rad
    assert odom.off() == EXACT


@given(st.sampled_from([1.0, -1.0]), st.floats(0.0, 1.0))
def test_distance_wraps_either_way(direction: float, short_of: float) -> None:
    odom = started(distance=direction * (DISTANCE_WRAP_M / 2 - short_of))
    odom.board.linear = direction
    odom.drive(100)
    assert odom.off() == EXACT


def test_more_than_half_a_turn_in_a_gap_is_told_by_the_velocities() -> None:
    odom = started()
    odom.board.linear, odom.board.angular = 0.5, 1.0
    odom.update(counters=False)
    odom.drive(250, counters=False)  # 5 rad
    odom.board.tick()
    odom.update()
    assert odom.off() == EXACT
