"""Motions in the map: placements, fixes of the truth, corrections under way, a lost position."""

import math

import pytest

import t2
from t2.messages import Odometry
from tests.simulated_robot import SimulatedStack
from verification.harness.waiting import wait_until
from verification.search.condition_books import IGNORED

pytestmark = pytest.mark.simulated

COVARIANCE = (0.0025, 0.0, 0.0, 0.0, 0.0025, 0.0, 0.0, 0.0, 0.0025)
SHIFT = (10.0, -4.0)  # of the map against the simulated world, m


@pytest.fixture
def robot(simulated: t2.Robot) -> t2.Robot:
    return simulated


@pytest.fixture
def stack(simulated_stack: SimulatedStack) -> SimulatedStack:
    return simulated_stack


def true(stack: SimulatedStack) -> tuple[float, float, float]:
    """Return the true pose in the map."""
    pose = stack.vehicle.simulation.pose
    return pose.x + SHIFT[0], pose.y + SHIFT[1], pose.heading


def fix(robot: t2.Robot, stack: SimulatedStack, odometry: Odometry, away: float = 0.0) -> None:
    """Send a fix of the true pose."""
    x, y, heading = true(stack)
    robot.fix("tags", x + away, y, heading, COVARIANCE, odometry=odometry)


def off(stack: SimulatedStack, x: float, y: float) -> float:
    """Return the distance of the true pose from a place in the map."""
    return math.dist(true(stack)[:2], (x, y))


def start_fixes(robot: t2.Robot, stack: SimulatedStack, count: int = 400) -> None:
    """Send a fix of the truth 10 times a second, in a thread."""

    def run() -> None:
        for _ in range(count):
            fix(robot, stack, robot.odometry.latest())
            stack.clock.sleep(0.1)

    stack.start(run)


def test_a_motion_in_the_map_survives_corrections(robot: t2.Robot, stack: SimulatedStack) -> None:
    x, y, heading = true(stack)
    robot.place(x + 0.3, y - 0.3, heading, sigma=0.5)  # 0.4 m beside the truth
    goal = x + 2.0, y + 1.0
    start_fixes(robot, stack)
    with robot.drive("nav") as drive:
        drive.follow([(x + 1.0, y), goal], heading=1.2, frame="map")
        assert off(stack, *goal) < 0.1
        drive.goto(x, y, heading, frame="map")
    assert off(stack, x, y) < 0.1
    assert abs(math.remainder(true(stack)[2] - heading, math.tau)) < 0.1
    (state,) = robot.localization.latest().sources
    assert state.used > 50
    assert state.refused <= 2


def test_odometry_that_is_set_does_not_end_a_motion_in_the_map(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    robot.place(*true(stack), sigma=0.01)
    x, y, _ = true(stack)

    def set_pose() -> None:
        wait_until(lambda: robot.velocity.latest().linear > 0.1, "motion")
        robot.set_pose(x=77.0)

    setting = stack.start(set_pose)
    with robot.drive("nav") as drive:
        drive.goto(x + 1.5, y, frame="map")
    setting.join()
    assert robot.odometry.latest().x > 70
    assert off(stack, x + 1.5, y) < 0.15


def test_a_large_correction_is_no_lack_of_progress(robot: t2.Robot, stack: SimulatedStack) -> None:
    x, y, heading = true(stack)
    robot.place(x + 2.0, y, heading, sigma=0.6)  # it believes to be 2 m farther

    def correct() -> None:
        wait_until(lambda: robot.velocity.latest().linear > 0.2, "motion")
        fix(robot, stack, robot.odometry.latest())

    correcting = stack.start(correct)
    with robot.drive("nav") as drive:
        drive.goto(x + 3.0, y, patience=1.0, frame="map")
    correcting.join()
    assert off(stack, x + 3.0, y) < 0.2


@pytest.mark.parametrize(("ahead", "aside"), [(-2.0, 0.0), (0.0, 1.5), (-1.0, 1.0)])
@pytest.mark.parametrize("left", [0.6, 1.0])
def test_a_correction_near_the_end_is_driven_back(
    robot: t2.Robot, stack: SimulatedStack, ahead: float, aside: float, left: float
) -> None:
    """The correction is beside the line, or past its end."""
    x, y, heading = true(stack)
    robot.place(x + ahead, y + aside, heading, sigma=0.8)
    goal = x + 2.0 + ahead, y + aside

    def correct() -> None:
        def is_near() -> bool:
            pose = robot.localization.latest()
            return math.dist((pose.x or 0.0, pose.y or 0.0), goal) < left

        wait_until(is_near, "the end")
        fix(robot, stack, robot.odometry.latest())

    correcting = stack.start(correct)
    with robot.drive("nav") as drive:
        drive.goto(*goal, frame="map")
    correcting.join()
    assert off(stack, *goal) < 0.2


def test_a_correction_of_the_heading_is_no_lack_of_progress(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    x, y, heading = true(stack)
    robot.place(x, y, heading + 1.9, sigma=0.1, heading_sigma=0.49)
    goal = x + 2 * math.cos(heading + 3.9), y + 2 * math.sin(heading + 3.9)

    def correct() -> None:
        wait_until(lambda: robot.odometry.latest().heading > heading + 1.7, "the end of the turn")
        fix(robot, stack, robot.odometry.latest())

    correcting = stack.start(correct)
    with robot.drive("nav") as drive:
        drive.goto(*goal, frame="map")
    correcting.join()
    assert off(stack, *goal) < 0.2


def test_without_a_placement_no_motion_in_the_map_begins(robot: t2.Robot) -> None:
    with (
        robot.drive("nav") as drive,
        pytest.raises(t2.Lost, match="place the vehicle"),
    ):
        drive.goto(1.0, 0.0, frame="map")


def test_a_lost_position_ends_a_motion_with_what_is_left(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    x, y, heading = true(stack)
    robot.place(x, y, heading, sigma=0.01)

    def contradict() -> None:
        wait_until(lambda: robot.velocity.latest().linear > 0.1, "motion")
        for _ in range(8):
            fix(robot, stack, robot.odometry.latest(), away=5.0)
            stack.clock.sleep(0.1)

    contradicting = stack.start(contradict)
    text = r"5 fixes of tags .*Left of the motion: \d"
    with pytest.raises(t2.Lost, match=text) as lost, robot.drive("nav") as drive:
        drive.goto(x + 3.0, y, frame="map")
    contradicting.join()
    assert 0.5 < (lost.value.left or 0.0) < 3.0
    assert lost.value.unit == "m"
    wait_until(lambda: abs(robot.velocity.latest().linear) < 0.02, "standstill")


def test_a_placement_ends_a_motion(robot: t2.Robot, stack: SimulatedStack) -> None:
    x, y, heading = true(stack)
    robot.place(x, y, heading)

    def place() -> None:
        wait_until(lambda: robot.velocity.latest().linear > 0.1, "motion")
        limit = robot.limit(IGNORED, linear=0.0, seconds=60)
        wait_until(lambda: abs(robot.odometry.latest().linear) < 0.001, "standstill")
        robot.place(x, y, heading)
        limit.end()

    placing = stack.start(place)
    with pytest.raises(t2.PoseSet, match="placed anew"), robot.drive("nav") as drive:
        drive.goto(x + 3.0, y, frame="map", on_stop="wait")
    placing.join()


def test_fixes_are_checked_before_they_are_sent(robot: t2.Robot) -> None:
    odometry = robot.odometry.latest()
    with pytest.raises(t2.NotAllowed, match="does not list 'gnss'; it lists tags"):
        robot.fix("gnss", 0.0, 0.0, None, COVARIANCE, odometry=odometry)
    with pytest.raises(ValueError, match="has 9 numbers, not 3"):
        robot.fix("tags", 0.0, 0.0, None, (1.0, 1.0, 1.0), odometry=odometry)
    with pytest.raises(ValueError, match="finite"):
        robot.fix("tags", math.nan, 0.0, None, COVARIANCE, odometry=odometry)


def test_a_moving_vehicle_is_not_placed(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.3, seconds=5)
        wait_until(lambda: robot.velocity.latest().linear > 0.1, "motion")
        with pytest.raises(t2.Refused, match="moves"):
            robot.place(0.0, 0.0, 0.0)
