"""The estimate against the truth: arcs, lost samples, restarts, poses that are set, slip."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.pose import Pose
from services.odom.config import Odom
from services.odom.core import estimator
from services.odom.core.estimator import SEGMENTS_MAX, START, Estimator, SlipDetector
from services.odom.core.noise import HOLD_S
from services.odom.core.pose import ArcSegment
from t2.messages import Velocity
from tests.odom.core.odom_fixture import (
    EXACT,
    TICK_NS,
    Board,
    apart,
    driving,
    parts,
    speeds,
    started,
    turnings,
)

Parts = list[tuple[float, float, list[tuple[bool, bool]]]]

# --- arcs and lost samples ------------------------------------------------------------------


@given(parts, st.booleans())
def test_after_lost_frames_distance_and_heading_are_those_of_the_counters(
    way: Parts, coarse: bool
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


@given(parts)
def test_lost_counters_leave_no_error_while_velocities_come(way: Parts) -> None:
    """A gap in the counters costs nothing: the velocities know the shape of the way."""
    odom = started()
    for linear, angular, received in way:
        odom.board.linear, odom.board.angular = linear, angular
        odom.update(counters=False)
        for counters, _ in received:
            odom.board.tick()
            odom.update(counters=counters)
    assert odom.off() == EXACT


@given(speeds, turnings, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_wrong_velocities_do_not_stay(
    linear: float, angular: float, wrong_linear: float, wrong_angular: float
) -> None:
    """The counters take back velocities that are off by a constant."""
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


def test_a_long_gap_of_the_counters_is_bounded_and_exact() -> None:
    odom = started()
    odom.board.linear, odom.board.angular = 1.0, 0.8  # more than half a turn
    odom.update(counters=False)
    odom.drive(SEGMENTS_MAX, counters=False)
    assert len(odom.estimator._segments) == SEGMENTS_MAX == 512
    odom.drive(100, counters=False)
    assert len(odom.estimator._segments) <= SEGMENTS_MAX
    odom.board.tick()
    odom.update()
    assert odom.off() == EXACT


# --- published ------------------------------------------------------------------------------


def test_a_velocity_is_valid_for_its_hold() -> None:
    assert Estimator(Odom()).estimate(NS_PER_S) is None
    odom = driving()
    hold_ns = round(HOLD_S * NS_PER_S)
    odometry = odom.odometry(hold_ns)
    assert (odometry.linear, odometry.angular) == (0.8, 0.3)
    assert odometry.twist_covariance == (0.02**2, 0.0, 0.0, 0.02**2)
    assert odom.estimator.estimate(odom.board.now_ns + hold_ns + 1) is None


def test_a_sample_from_before_the_last_one_does_not_move_time_back() -> None:
    odom = driving()
    odom.estimator.on_velocity(odom.board.velocity(), odom.board.now_ns - TICK_NS)
    assert odom.off() == EXACT


def test_covariance_grows_by_way_and_gap_whatever_the_rate() -> None:
    often, rarely, gap = driving(), driving(), driving()
    often.drive(100)
    for _ in range(50):
        rarely.board.tick(2)
        rarely.update()
    gap.board.tick(100)
    gap.update()
    before = driving().odometry().pose_covariance[0]
    areas = [odom.odometry().pose_covariance[0] for odom in (often, rarely, gap)]
    assert before < areas[0] == pytest.approx(areas[1], rel=0.01)
    assert areas[2] > 2 * areas[0]


def test_a_velocity_that_is_over_adds_no_time_before_the_last_input() -> None:
    estimator = Estimator(Odom())
    estimator.on_velocity(Velocity(linear=0.5, angular=0.0), NS_PER_S)
    estimator.on_mileage(Board().mileage(), 2 * NS_PER_S)
    estimator.on_velocity(Velocity(linear=0.5, angular=0.0), 3 * NS_PER_S)
    assert estimator._segments == [ArcSegment(0.0, 0.0, 1.0, seen=False)]


# --- restarts, and a pose that is set -------------------------------------------------------


@pytest.mark.parametrize(
    "changes",
    [
        {"distance": 0.0, "heading": 0.0, "epoch": 1},  # the board
        {"boot": 2, "epoch": 0},  # the bridge
        {"distance": 0.0, "heading": 0.0, "boot": 2},  # both
    ],
)
@pytest.mark.parametrize("pause", [0, 3, 300])
def test_a_restart_does_not_move_the_pose(changes: dict[str, float], pause: int) -> None:
    odom = driving()
    for name, value in changes.items():
        setattr(odom.board, name, value)
    odom.board.now_ns += pause * TICK_NS
    before = odom.estimator._predicted.pose
    assert odom.update(velocity=False) is True
    held_s = min(pause * TICK_NS / NS_PER_S, HOLD_S)
    held = before.moved(0.8 * held_s, 0.3 * held_s)
    assert apart(odom.estimator._corrected.pose, held) == EXACT
    odom.board.truth = held
    odom.update(counters=False)
    odom.board.tick()
    assert odom.update() is False
    odom.drive(100)
    assert odom.off() == EXACT
    assert odom.odometry().epoch == 0


poses = st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))


@given(speeds, turnings, st.integers(0, 3), poses)
def test_a_pose_set_while_driving_is_followed_exactly(
    linear: float, angular: float, ticks: int, pose: Pose
) -> None:
    odom = started()
    odom.board.linear, odom.board.angular = linear, angular
    odom.drive(20)
    odom.board.tick(ticks)
    for _ in range(2):
        odom.estimator.place(pose, odom.board.now_ns)
    odom.board.truth = pose
    assert odom.off() == EXACT
    assert odom.odometry().pose_covariance == START.rows()
    assert abs(odom.pose().heading) <= math.pi
    assert odom.update() is False
    odom.drive(20)
    assert odom.off() == EXACT
    assert odom.odometry().epoch == 2


# --- slip -----------------------------------------------------------------------------------


def arc(distance: float, turn: float = 0.0, *, seen: bool = True) -> ArcSegment:
    return ArcSegment(distance, turn, 0.02, seen)


def compared(ticks: int, counted: ArcSegment, integrated: ArcSegment) -> SlipDetector:
    """Return a detector of so many samples."""
    detector = SlipDetector()
    for tick in range(1, ticks + 1):
        detector.add(tick * TICK_NS, counted, integrated)
    detector.update(ticks * TICK_NS)
    return detector


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("counted", "turned", "slip"),
    [(0.011, 0.0, True), (0.009, 0.0, False), (0.0, 0.021, True), (0.0, 0.019, False)],
)
def test_slip_by_distance_or_by_turn(sign: int, counted: float, turned: float, slip: bool) -> None:
    detector = compared(10, arc(0.5 + sign * counted, 0.3 + sign * turned), arc(0.5, 0.3))
    assert detector.slip is slip
    assert detector.residual == pytest.approx(10 * sign * counted)


def test_before_the_first_comparison_nothing_slips() -> None:
    detector = SlipDetector()
    assert detector.slip is False
    assert detector.residual is None


def test_only_the_last_second_is_compared() -> None:
    detector = compared(500, arc(0.02), arc(0.019))
    assert detector.residual == pytest.approx(0.051)
    detector.update(502 * TICK_NS + NS_PER_S)
    assert detector.residual is None


@pytest.mark.parametrize("counted", [arc(1 / 64), arc(0.0, 1 / 64)])
def test_slip_falls_at_half_of_its_limit(
    counted: ArcSegment, monkeypatch: pytest.MonkeyPatch
) -> None:
    for limit in ("SLIP_M", "SLIP_RAD"):
        monkeypatch.setattr(estimator, limit, 0.125)  # a binary fraction adds up exactly
    detector, slips = SlipDetector(), []
    for tick in range(1, 10):
        detector.add(tick * TICK_NS, counted, arc(0.0))
    for samples_left in (9, 5, 4):
        detector.update((10 - samples_left) * TICK_NS + NS_PER_S)
        slips.append(detector.slip)
    assert slips == [True, True, False]
    assert detector.residual == 4 * counted.distance


def test_a_motion_without_velocities_and_the_next_one_are_not_compared() -> None:
    """After a stall of the counters, the next sample covers the gap."""
    detector = compared(10, arc(0.02), arc(0.0, seen=False))
    assert (detector.residual, detector.slip) == (None, False)
    detector.add(11 * TICK_NS, arc(0.5), arc(0.01))
    detector.add(12 * TICK_NS, arc(0.02), arc(0.01))
    detector.update(12 * TICK_NS)
    assert detector.residual == pytest.approx(0.01)


@pytest.mark.parametrize(("linear", "angular"), [(0.8, 0.0), (0.0, 0.8)])
def test_counters_that_do_not_follow_the_velocities_are_published_as_slip(
    linear: float, angular: float
) -> None:
    odom = started(linear=linear, angular=angular)
    odom.drive(100)
    assert odom.odometry().slip is False
    for _ in range(20):
        odom.board.now_ns += TICK_NS  # the wheels turn, the counters do not
        odom.update()
    assert odom.odometry().slip is True
    assert odom.odometry().residual == pytest.approx(-linear * 0.4, abs=0.03)
