"""The estimate against the truth: arcs, gaps, wraps, restarts, resets, hostile samples."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import S
from common.messages import Mileage, Velocity
from services.odom.config import Odom
from services.odom.estimator import DISTANCE_WRAP_M, LEGS_MAX, Estimator, Outcome
from services.odom.pose import Pose
from tests.odom.drive import TICK_NS, Board, Listener, apart, minors, pose_of

EXACT = pytest.approx((0.0, 0.0), abs=1e-6)

speeds = st.floats(-1.5, 1.5)
turnings = st.floats(-1.5, 1.5)


def started(**board: float) -> Listener:
    """Return a listener that has heard the counters once, beside a board at rest."""
    listener = Listener(Board(**board))  # type: ignore[arg-type]
    listener.hear()
    return listener


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

losses = st.lists(st.tuples(st.booleans(), st.booleans()), max_size=40)
parts = st.lists(st.tuples(speeds, turnings, losses), max_size=5)


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
    assert math.hypot(pose.x, pose.y) <= fastest * TICK_NS / S + 0.001 * (len(way) + 1)


@given(st.lists(st.tuples(speeds, turnings, st.booleans()), max_size=40))
def test_counters_alone_make_arcs_of_what_was_not_lost(
    way: list[tuple[float, float, bool]],
) -> None:
    listener = started()
    expected, distance, turn = Pose(0.0, 0.0, 0.0), 0.0, 0.0
    for linear, angular, heard in way:
        listener.board.linear, listener.board.angular = linear, angular
        listener.board.tick()
        distance += linear * TICK_NS / S
        turn += angular * TICK_NS / S
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


# --- restarts -------------------------------------------------------------------------------


def driving() -> Listener:
    """Return a listener beside a board that has driven a while."""
    listener = started(distance=70.0, heading=2.0)
    listener.board.linear, listener.board.angular = 0.8, 0.3
    listener.drive(100)
    return listener


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
    listener = driving()
    expected = restart(listener.board)
    listener.board.now_ns += pause * TICK_NS
    before = listener.estimator.estimate(listener.board.now_ns)
    lead = listener.estimator._lead
    assert listener.hear(velocity=False) is expected
    after = listener.estimator.estimate(listener.board.now_ns)
    if before is not None and after is not None:
        assert apart(pose_of(before), pose_of(after)) == EXACT
    held = lead.pose.moved(0.8 * min(pause * 0.02, 0.1), 0.3 * min(pause * 0.02, 0.1))
    assert apart(listener.estimator._lead.pose, held) == EXACT


@pytest.mark.parametrize("restart", RESTARTS)
def test_counting_goes_on_after_a_restart(restart: object) -> None:
    assert callable(restart)
    listener = driving()
    restart(listener.board)
    listener.hear()
    listener.drive(100)
    assert listener.off() == EXACT
    assert listener.odometry().epoch == 0


def test_the_host_starts_at_zero_wherever_the_counters_stand() -> None:
    listener = started(distance=123.0, heading=-3.0)
    assert listener.pose() == Pose(0.0, 0.0, 0.0)


def test_uncertainty_grows_over_a_restart() -> None:
    listener, other = driving(), driving()
    for each in (listener, other):
        each.board.now_ns += S
    restart_board(listener.board)
    listener.hear()
    other.hear()
    assert listener.odometry().pose_covariance[8] > other.odometry().pose_covariance[8]


# --- a pose from an operator ----------------------------------------------------------------


poses = st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))


@given(speeds, turnings, st.integers(0, 3), poses)
def test_a_pose_set_while_driving_is_followed_exactly(
    linear: float, angular: float, ticks: int, pose: Pose
) -> None:
    listener = started()
    listener.board.linear, listener.board.angular = linear, angular
    listener.drive(20)
    listener.board.tick(ticks)
    listener.estimator.place(pose, listener.board.now_ns)
    listener.board.truth = pose
    assert listener.off() == EXACT
    listener.drive(20)
    assert listener.off() == EXACT
    assert listener.odometry().epoch == 1


def test_a_pose_that_is_set_is_certain_again() -> None:
    listener = driving()
    before = listener.odometry().pose_covariance
    listener.estimator.place(Pose(0.0, 0.0, 7.0), listener.board.now_ns)
    after = listener.odometry()
    assert after.pose_covariance[0] < before[0]
    assert after.heading == pytest.approx(7.0 - math.tau)


def test_a_pose_can_be_set_before_anything_is_heard() -> None:
    listener = Listener(Board())
    listener.estimator.place(Pose(1.0, 2.0, 0.5), listener.board.now_ns)
    listener.hear()
    assert listener.pose() == Pose(1.0, 2.0, 0.5)


# --- what is published, and when ------------------------------------------------------------


def test_nothing_is_said_before_anything_is_heard() -> None:
    assert Estimator(Odom()).estimate(S) is None


def test_one_counter_sample_makes_no_twist() -> None:
    listener = Listener(Board())
    listener.hear(velocity=False)
    assert listener.estimator.estimate(listener.board.now_ns) is None


def test_the_last_velocity_holds_and_then_there_is_silence() -> None:
    listener = driving()
    hold_ns = round(Odom().hold * S)
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


# --- covariance -----------------------------------------------------------------------------


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


# --- hostile samples ------------------------------------------------------------------------

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
