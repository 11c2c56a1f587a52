"""Drives on the simulated stack, in simulated time: where motions end, and what stops them."""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import t2
import t2.client
import t2.drive
from sim.requests import Sonar
from t2.client import is_blocked
from t2.messages import Drive, Odometry
from t2.motion import Straight
from tests.sdk.library_robot import blocked
from tests.simulated_robot import SimulatedStack
from verification.harness.waiting import wait_until
from verification.search.condition_books import IGNORED

pytestmark = pytest.mark.simulated

HoldUp = Callable[[Callable[[], object]], None]


@pytest.fixture
def robot(simulated: t2.Robot) -> t2.Robot:
    return simulated


@pytest.fixture
def stack(simulated_stack: SimulatedStack) -> SimulatedStack:
    return simulated_stack


def await_motion(robot: t2.Robot, least: float = 0.1) -> None:
    """Wait until the vehicle drives forward."""
    wait_until(lambda: robot.velocity.latest().linear > least, "motion")


def await_standstill(robot: t2.Robot) -> None:
    wait_until(lambda: abs(robot.velocity.latest().linear) < 0.02, "standstill")


def test_a_velocity_ends_by_itself_or_with_the_drive(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(np.float64(0.2), seconds=np.float64(0.6))
        await_motion(robot)
        await_standstill(robot)
        drive.velocity(0.2, seconds=10)
        await_motion(robot)
    await_standstill(robot)


def test_a_velocity_that_nobody_renews_ends_while_the_drive_stays_open(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.1)
        end_s = drive._target.end_s
        assert 0.0 < end_s - stack.clock.monotonic() <= 0.5
        await_motion(robot, 0.02)
        await_standstill(robot)  # the program waits for something
        assert stack.clock.monotonic() >= end_s
        assert drive.is_open
        drive.velocity(0.1, seconds=10)
        await_motion(robot, 0.02)


def test_what_is_no_finite_number_is_refused(robot: t2.Robot) -> None:
    text: Any = "0.2"
    with robot.drive("nav") as drive:
        for move in (drive.velocity, drive.forward, drive.turn):
            for number in (math.nan, math.inf):
                with pytest.raises(ValueError, match="only finite"):
                    move(number)
            with pytest.raises(TypeError):
                move(text)
        with pytest.raises(ValueError, match="speed must be positive"):
            drive.forward(1.0, speed=-0.3)
        with pytest.raises(ValueError, match="seconds must not be negative"):
            drive.velocity(0.1, seconds=-5)
        for number in (10.1, math.inf):
            with pytest.raises(ValueError, match="valid for 10 s at most"):
                drive.velocity(0.1, seconds=number)
        none: Any = None
        with pytest.raises(TypeError):
            drive.velocity(0.1, seconds=none)
        word: Any = "skip"
        with pytest.raises(ValueError, match="'skip' is not one of raise, wait"):
            drive.forward(1.0, on_stop=word)
    with pytest.raises(ValueError, match="not be negative"):
        robot.limit(IGNORED, linear=-1.0, seconds=1)
    call: Any = robot.limit
    with pytest.raises(TypeError, match="seconds"):
        call("detector", linear=0.3)


def test_a_distance_and_a_turn_of_numpy_numbers(robot: t2.Robot) -> None:
    start = robot.odometry.latest()
    with robot.drive("nav") as drive:
        drive.forward(np.float64(0.2))
        there = robot.odometry.latest()
        assert math.dist((start.x, start.y), (there.x, there.y)) == pytest.approx(0.2, abs=0.05)
        drive.turn(np.float64(-0.4), np.float64(0.5), np.float64(3.0))
        turned = math.remainder(robot.odometry.latest().heading - there.heading, math.tau)
        assert turned == pytest.approx(-0.4, abs=0.1)
    with robot.drive("nav"):  # the next drive of a program is no second publisher
        causes = {cause.name for cause in robot.safety.latest().causes}
        assert "two_publishers" not in causes


def test_arcs_and_paths_end_at_their_places(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        pose = drive.arc(0.5, math.pi / 2)
        assert (pose.x, pose.y) == pytest.approx((0.5, 0.5), abs=0.1)
        assert pose.heading == pytest.approx(math.pi / 2, abs=0.1)
        assert len(pose.pose_covariance) == 9
        pose = drive.follow([(0.5, 1.0), (np.float64(1.2), 1.0)])
        assert (pose.x, pose.y) == pytest.approx((1.2, 1.0), abs=0.1)
        pose = drive.goto(0.6, 0.8, heading=0.0)
        assert (pose.x, pose.y) == pytest.approx((0.6, 0.8), abs=0.1)
        assert pose.heading == pytest.approx(0.0, abs=0.1)
        assert drive.goto(pose.x, pose.y).seq > pose.seq
        with pytest.raises(ValueError, match="only finite"):
            drive.goto(0.0, 0.0, math.nan)
        with pytest.raises(ValueError, match="radius must be positive"):
            drive.arc(-1.0, 1.0)


@pytest.fixture
def hold_up(robot: t2.Robot, monkeypatch: pytest.MonkeyPatch) -> HoldUp:
    """Return a function that holds up the next motion while it drives, to call something."""

    def hold_up(call: Callable[[], object]) -> None:
        calls = [call]
        velocity = Straight.velocity

        def held(motion: Straight, pose: Odometry, left: float) -> tuple[float, float]:
            if calls and pose.linear > 0.1:
                calls.pop()()
            return velocity(motion, pose, left)

        monkeypatch.setattr(Straight, "velocity", held)

    return hold_up


def test_a_motion_that_is_held_up_requests_zero_and_goes_on(
    robot: t2.Robot, hold_up: HoldUp
) -> None:
    def wait() -> None:
        with pytest.raises(t2.T2Error, match="a motion of this drive is under way"):
            drive.turn(0.1)
        await_standstill(robot)

    hold_up(wait)
    start = robot.odometry.latest()
    with robot.drive("nav") as drive:
        end = drive.forward(0.6, on_stop="wait")
    assert math.dist((start.x, start.y), (end.x, end.y)) == pytest.approx(0.6, abs=0.1)


def test_a_stop_ends_a_motion_that_is_held_up(robot: t2.Robot, hold_up: HoldUp) -> None:
    def stop_for_a_while() -> None:
        await_standstill(robot)
        limit = robot.limit(IGNORED, linear=0.0, seconds=60)
        wait_until(lambda: not drive.obeyed, "the stop")
        limit.set(None, seconds=0.1)
        wait_until(lambda: drive.obeyed or drive._error, "its end")

    hold_up(stop_for_a_while)
    with pytest.raises(t2.Stopped) as stopped, robot.drive("nav") as drive:
        drive.forward(0.6)
    assert 0.0 < (stopped.value.left or 0.0) < 0.6


def test_a_latch_ends_a_drive_for_good(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=10)
        robot.estop()
        with pytest.raises(t2.Latched) as stopped:
            drive.forward(1.0)
        assert [cause.name for cause in stopped.value.causes] == ["estop"]
        with pytest.raises(t2.Latched), robot.drive("web"):
            pass
        wait_until(lambda: not blocked(robot), "the reset")
        with pytest.raises(t2.Latched):
            drive.velocity(0.3, seconds=10)
    with pytest.raises(t2.Refused, match="Nothing needs a reset"):
        robot.reset()


def test_another_source_of_higher_priority_overrules(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.05, seconds=10)
        stack.sources["teleop"].message = Drive(linear=0.0, angular=0.0, echo=0)
        with pytest.raises(t2.Overruled) as overruled:
            drive.forward(5.0, speed=0.05)
    assert overruled.value.by == "teleop"


def test_an_obstacle_blocks_a_distance(robot: t2.Robot, stack: SimulatedStack) -> None:
    stack.vehicle.inject(Sonar(name="front", range=0.2))
    began_s = stack.clock.monotonic()
    with pytest.raises(t2.Blocked) as stopped, robot.drive("nav") as drive:
        drive.forward(1.0, patience=0.5)
    assert stopped.value.causes
    assert stopped.value.left == pytest.approx(1.0, abs=0.1)
    assert stopped.value.unit == "m"
    assert re.search(r"Left of the motion: \d\.\d\d m\.$", str(stopped.value))
    assert stack.clock.monotonic() - began_s >= 0.5


def test_a_motion_that_waits_goes_on_when_the_obstacle_is_gone(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    def go_away() -> None:
        wait_until(lambda: drive.is_open and is_blocked(robot.safety.latest()), "the obstacle")
        stack.clock.sleep(1.0)  # longer than the patience
        stack.vehicle.inject(Sonar(name="front"))

    stack.vehicle.inject(Sonar(name="front", range=0.2))
    start = robot.odometry.latest()
    with robot.drive("nav") as drive:
        going = stack.start(go_away)
        end = drive.forward(0.3, patience=0.6, on_stop="wait")
        going.join()
    assert math.dist((start.x, start.y), (end.x, end.y)) == pytest.approx(0.3, abs=0.1)


def test_a_slow_motion_is_as_slow_as_asked(robot: t2.Robot) -> None:
    fastest = 0.0

    def note(velocity: t2.messages.Velocity) -> None:
        nonlocal fastest
        fastest = max(fastest, abs(velocity.linear))

    with robot.velocity.on(note), robot.drive("nav") as drive:
        drive.forward(0.03, speed=0.02)
        assert 0.01 < fastest < 0.03
        drive.forward(0.05, speed=0.05, patience=0.1)


def test_requests_that_arrive_too_late_are_named(
    robot: t2.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = "safety has received no request of 'nav' in time"

    def drive_with_old_echoes() -> None:
        with robot.drive("nav") as drive:
            drive.velocity(0.05, seconds=10)
            await_motion(robot, 0.02)
            monkeypatch.setattr(t2.client.Access, "received", lambda *_: None)
            wait_until(drive.check, "the error")

    with pytest.raises(t2.Late, match=late):
        drive_with_old_echoes()
    with pytest.raises(t2.Late, match=rf"{late}.*a round trip took \d+\.\d+ s"):
        robot.drive("nav").__enter__()


@pytest.mark.parametrize("order", [1, -1])
def test_a_suspended_program_is_told_so_whichever_thread_wakes_first(
    robot: t2.Robot, stack: SimulatedStack, order: int
) -> None:
    def suspend() -> None:
        await_motion(robot, 0.02)
        stack.suspend(1500)  # longer than HELD_S
        stack.clock.reorder(order)

    suspending = stack.start(suspend)
    with pytest.raises(t2.Late, match="this program was held up for"), robot.drive("nav") as drive:
        drive.forward(5.0, speed=0.05)
    suspending.join()


def test_a_pose_that_is_set_ends_a_motion(robot: t2.Robot, stack: SimulatedStack) -> None:
    def set_pose() -> None:
        await_motion(robot, 0.02)
        robot.set_pose(np.float64(0.5))

    setting = stack.start(set_pose)
    with pytest.raises(t2.PoseSet), robot.drive("nav") as drive:
        drive.forward(5.0, speed=0.05)
    setting.join()


def test_a_protective_stop_is_raised_and_the_next_drive_sends_a_neutral_request(
    robot: t2.Robot,
) -> None:
    def drive_on() -> None:
        with robot.drive("nav") as drive:
            drive.velocity(0.05, seconds=10)
            await_motion(robot, 0.02)
            robot.limit(IGNORED, linear=0.0, seconds=0.5)
            wait_until(drive.check, "the stop")

    with pytest.raises(t2.Stopped) as stop:
        drive_on()
    assert {cause.name for cause in stop.value.causes} & {"limit_stop", "neutral"}
    wait_until(lambda: not blocked(robot), "a vehicle that may drive")
    with robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=10)
        await_motion(robot)


def test_a_motion_waits_for_the_end_of_a_protective_stop(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    start = robot.odometry.latest()
    stopped: list[bool] = []

    def stop_for_a_while() -> None:
        await_motion(robot)
        limit = robot.limit(IGNORED, linear=0.0, seconds=60)
        await_standstill(robot)
        stopped.append(drive.obeyed)
        stack.clock.sleep(0.5)
        limit.set(None, seconds=60)

    with robot.drive("nav") as drive:
        stopping = stack.start(stop_for_a_while)
        pose = drive.forward(0.6, patience=0.3, on_stop="wait")
        stopping.join()
        assert stopped == [False]
        assert math.dist((start.x, start.y), (pose.x, pose.y)) == pytest.approx(0.6, abs=0.1)
        drive.velocity(0.1, seconds=10, on_stop="wait")
        wait_until(lambda: drive.obeyed, "an obeyed request")
        robot.limit(IGNORED, linear=0.0, seconds=60)
        wait_until(lambda: not drive.obeyed, "the stop")
        drive.check()
        with pytest.raises(t2.Stopped):
            drive.velocity(0.1, seconds=10)


def test_the_wait_for_the_end_of_a_stop_has_an_end(
    robot: t2.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(t2.drive, "WAIT_S", 0.5)
    with robot.drive("nav") as drive:
        drive.velocity(0.1, seconds=10, on_stop="wait")
        limit = robot.limit(IGNORED, linear=0.0, seconds=60)
        with pytest.raises(t2.Stopped):
            wait_until(drive.check, "the end of the wait")
        limit.end()


def test_a_drive_is_entered_once_and_alone(robot: t2.Robot) -> None:
    drive = robot.drive("nav")
    with pytest.raises(t2.T2Error, match="not entered"):
        drive.velocity(0.2, seconds=10)
    with drive:
        for other in (robot.drive("nav"), drive):
            with pytest.raises(t2.T2Error, match="is open"), other:
                pass
    with pytest.raises(t2.T2Error, match="is closed"), drive:
        pass
    with robot.drive("nav"):
        pass


def test_a_cancel_ends_the_next_motion(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.cancel()
        drive.check()  # of another thread: the cancel stays
        with pytest.raises(t2.T2Error, match="cancelled"):
            drive.forward(5.0)
        drive.cancel()
        with pytest.raises(t2.T2Error, match="cancelled"):
            drive.velocity(0.2, seconds=10)
        drive.velocity(0.2, seconds=10)
        await_motion(robot)
