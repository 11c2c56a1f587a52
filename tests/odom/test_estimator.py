"""The estimate against the truth: arcs, gaps and wraps."""

import math

from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.messages import Velocity
from services.odom.estimator import LEGS_MAX
from services.odom.pose import Pose
from services.odom.standstill import DISTANCE_WRAP_M
from tests.odom.drive import (
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
    listener = started()
    listener.board.linear, listener.board.angular = linear, angular
    listener.drive(ticks, velocity=False)
    lead = listener.estimator._lead.pose
    assert apart(lead, listener.board.truth) == EXACT


@given(speeds, turnings, st.integers(1, 4))
def test_velocities_carry_the_pose_to_now(linear: float, angular: float, ticks: int) -> None:
    listener = started()
    listener.board.linear, listener.board.angular = linear, angular
    listener.hear(counters=False)
    listener.board.tick(ticks)
    assert listener.off() == EXACT


def test_asking_does_not_change_the_answer() -> None:
    listener = started()
    listener.board.linear = 1.0
    listener.drive(3)
    assert listener.odometry(10_000_000) == listener.odometry(10_000_000)


# --- gaps -----------------------------------------------------------------------------------


@given(parts, st.booleans())
def test_after_lost_frames_distance_and_heading_are_those_of_the_counters(
    way: list[tuple[float, float, list[tuple[bool, bool]]]], coarse: bool
) -> None:
    """Whatever is lost: the heading is the counters', and the way is no longer than they say."""
    listener = started()
    listener.board.coarse = coarse
    for linear, angular, heard in way:
        listener.board.linear, listener.board.angular = linear, angular
        for counters, velocity in heard:
            listener.board.tick()
            listener.hear(counters=counters, velocity=velocity)
    listener.board.tick()
    listener.hear()
    pose, board = listener.pose(), listener.board
    assert apart(pose, board.truth)[1] <= math.radians(0.05) + 1e-9
    fastest = sum(abs(linear) * len(heard) for linear, _, heard in way) + 1.5
    assert math.hypot(pose.x, pose.y) <= fastest * TICK_NS / NS_PER_S + 0.001 * (len(way) + 1)


@given(st.lists(st.tuples(speeds, turnings, st.booleans()), max_size=40))
def test_counters_alone_make_arcs_of_what_was_not_lost(
    way: list[tuple[float, float, bool]],
) -> None:
    listener = started()
    expected, distance, turn = Pose(0.0, 0.0, 0.0), 0.0, 0.0
    for linear, angular, heard in way:
        listener.board.linear, listener.board.angular = linear, angular
        listener.board.tick()
        distance += linear * TICK_NS / NS_PER_S
        turn += angular * TICK_NS / NS_PER_S
        if heard:
            listener.hear(velocity=False)
            expected, distance, turn = expected.moved(distance, turn), 0.0, 0.0
    assert apart(listener.estimator._lead.pose, expected) == EXACT


@given(parts)
def test_lost_counters_leave_no_error_while_velocities_come(
    way: list[tuple[float, float, list[tuple[bool, bool]]]],
) -> None:
    """A gap in the counters costs nothing: the velocities know the shape of the way."""
    listener = started()
    for linear, angular, heard in way:
        listener.board.linear, listener.board.angular = linear, angular
        listener.hear(counters=False)
        for counters, _ in heard:
            listener.board.tick()
            listener.hear(counters=counters)
    assert listener.off() == EXACT


@given(speeds, turnings, st.lists(st.tuples(st.booleans(), st.booleans()), max_size=60))
def test_any_loss_on_a_constant_arc_leaves_no_error(
    linear: float, angular: float, heard: list[tuple[bool, bool]]
) -> None:
    listener = started()
    listener.board.linear, listener.board.angular = linear, angular
    listener.hear(counters=False)
    for counters, velocity in heard:
        listener.board.tick()
        listener.hear(counters=counters, velocity=velocity)
    listener.board.tick()
    listener.hear()
    assert listener.off() == EXACT


@given(speeds, turnings, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_wrong_velocities_do_not_stay(
    linear: float, angular: float, wrong_linear: float, wrong_angular: float
) -> None:
    """Velocities that are off by a constant are taken back by the counters, every one of them."""
    listener = started()
    board = listener.board
    board.linear, board.angular = linear, angular
    wrong = Velocity(linear=linear + wrong_linear, angular=angular + wrong_angular)
    listener.estimator.on_velocity(wrong, board.now_ns)
    for tick in range(60):
        board.tick()
        listener.hear(counters=tick % 7 == 3, velocity=False)
        listener.estimator.on_velocity(wrong, board.now_ns)
    board.tick()
    listener.hear(velocity=False)
    assert apart(listener.estimator._lead.pose, board.truth) == EXACT


def test_counters_in_their_own_steps_stay_within_them() -> None:
    listener = started()
    listener.board.coarse = True
    listener.board.linear, listener.board.angular = 0.7, 0.4
    listener.drive(1000)
    distance, turn = listener.off()
    assert turn <= math.radians(0.1)
    assert distance < 0.03  # 14 m of way in steps of 1 mm and 0.1 deg


def test_a_long_gap_of_the_counters_is_bounded_and_exact() -> None:
    listener = started()
    listener.board.linear, listener.board.angular = 1.0, 0.8
    listener.hear(counters=False)
    listener.drive(LEGS_MAX, counters=False)
    assert len(listener.estimator._legs) == LEGS_MAX == 512
    listener.drive(100, counters=False)
    assert len(listener.estimator._legs) <= LEGS_MAX
    listener.board.tick()
    listener.hear()
    assert listener.off() == EXACT


# --- wraps ----------------------------------------------------------------------------------


@given(st.sampled_from([1.0, -1.0]), st.floats(0.0, 2 * math.pi))
def test_heading_wraps_either_way(direction: float, offset: float) -> None:
    listener = started(heading=offset)
    listener.board.linear, listener.board.angular = 0.5, 4.0 * direction
    listener.drive(100)  # 8 rad
    assert listener.off() == EXACT


@given(st.sampled_from([1.0, -1.0]), st.floats(0.0, 1.0))
def test_distance_wraps_either_way(direction: float, short_of: float) -> None:
    listener = started(distance=direction * (DISTANCE_WRAP_M / 2 - short_of))
    listener.board.linear = direction
    listener.drive(100)
    assert listener.off() == EXACT


def test_more_than_half_a_turn_in_a_gap_is_told_by_the_velocities() -> None:
    listener = started()
    listener.board.linear, listener.board.angular = 0.5, 1.0
    listener.hear(counters=False)
    listener.drive(250, counters=False)  # 5 rad
    listener.board.tick()
    listener.hear()
    assert listener.off() == EXACT
