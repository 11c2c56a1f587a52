"""The client library on the real stack: drives, limits, stops and resets."""

import contextlib
import math
import threading
import time
from collections.abc import Iterator

import pytest

import t2
from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from sim.requests import Bumper, Sonar
from tests.sdk.library_robot import blocked
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed


def test_a_distance_and_a_turn(robot: t2.Robot) -> None:
    start = robot.odometry.latest()
    with robot.drive("nav") as drive:
        drive.forward(0.3)
        there = robot.odometry.latest()
        assert math.dist((start.x, start.y), (there.x, there.y)) == pytest.approx(0.3, abs=0.05)
        drive.turn(math.pi / 4)
        turned = math.remainder(robot.odometry.latest().heading - there.heading, math.tau)
        assert turned == pytest.approx(math.pi / 4, abs=0.1)


def test_the_next_drive_of_a_program_is_no_second_publisher(robot: t2.Robot) -> None:
    for _ in range(3):
        with robot.drive("nav"):
            causes = {cause.name for cause in robot.safety.latest().causes}
            assert "two_publishers" not in causes


def test_a_velocity_ends_by_itself_or_with_the_drive(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=2.0)
        wait_until(lambda: robot.velocity.latest().linear > 0.1, "motion")
        wait_until(lambda: robot.velocity.latest().linear < 0.02, "the end of the velocity")
        drive.velocity(-0.2)
        wait_until(lambda: robot.velocity.latest().linear < -0.1, "motion")
    wait_until(lambda: robot.velocity.latest().linear > -0.02, "the end of the drive")


def test_an_emergency_stop_latches_until_a_reset(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.2)
        robot.estop()
        with pytest.raises(t2.Latched) as stopped:
            drive.forward(1.0)
    assert [cause.name for cause in stopped.value.causes] == ["estop"]
    with pytest.raises(t2.Latched), robot.drive("nav"):
        pass
    robot.reset()
    with pytest.raises(t2.Refused, match="Nothing is latched"):
        robot.reset()


def test_a_pressed_bumper_refuses_the_reset(robot: t2.Robot, stack: RunningStack) -> None:
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: "contact" in robot.safety.latest().latched, "the contact")
    with pytest.raises(t2.Refused, match="bumper"):
        robot.reset()
    stack.control.do(Bumper(pressed=False))


@pytest.fixture
def pressed(robot: t2.Robot, stack: RunningStack) -> Iterator[None]:
    """Press the bumper while the vehicle drives forward, and wait for the latch."""
    try:
        with contextlib.suppress(t2.Latched), robot.drive("nav") as drive:
            drive.velocity(0.2)
            wait_until(lambda: robot.velocity.latest().linear > 0.1, "motion")
            stack.control.do(Bumper(pressed=True))
            drive.forward(5.0, speed=0.2)
        wait_until(lambda: "contact" in robot.safety.latest().latched, "the contact")
        yield
    finally:
        stack.control.do(Bumper(pressed=False))


@pytest.mark.usefixtures("pressed")
def test_a_release_creeps_until_the_bumper_is_free(robot: t2.Robot, stack: RunningStack) -> None:
    def free() -> None:
        wait_until(lambda: robot.velocity.latest().linear < -0.02, "creeping backward")
        stack.control.do(Bumper(pressed=False))

    freeing = threading.Thread(target=free)
    freeing.start()
    robot.release("backward", "teleop")
    freeing.join()
    assert not robot.bumper.latest().pressed
    assert robot.safety.latest().latched == ("contact",)
    wait_until(lambda: not blocked(robot), "the reset")
    robot.release("backward", "teleop")  # a free bumper needs none


@pytest.mark.usefixtures("pressed")
def test_a_release_that_frees_nothing_is_not_confirmed_then_refused(robot: t2.Robot) -> None:
    with pytest.raises(t2.NotConfirmed, match=r"still pressed after 0\.5 s"):
        robot.release("backward", "teleop", timeout=0.5)
    with pytest.raises(t2.Refused, match="by hand"):  # the travel of a release is used up
        robot.release("backward", "teleop", timeout=30.0)


@pytest.mark.usefixtures("pressed")
@pytest.mark.parametrize(("source", "reason"), [("teleop", "mergency stop"), ("nav", "operator")])
def test_a_release_that_safety_refuses_raises_the_reason(
    robot: t2.Robot, source: str, reason: str
) -> None:
    robot.estop()
    with pytest.raises(t2.Refused, match=reason):
        robot.release("forward", source, timeout=30.0)


def test_a_limit_slows_the_vehicle_down_until_it_ends(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=0.1, reason="person ahead", seconds=60)

    def is_shown() -> bool:
        return any(each.reason == "person ahead" for each in robot.safety.latest().limit_sources)

    wait_until(is_shown, "the limit")
    with robot.drive("nav") as drive:

        def becomes(verdict: str) -> None:
            def is_it() -> bool:
                drive.check()
                return robot.safety.latest().verdict == verdict

            wait_until(is_it, verdict)

        drive.velocity(0.3)
        becomes("slow")
        limit.end()
        becomes("run")
        again = robot.limit("detector", linear=0.1, seconds=60)
        becomes("slow")
        again.end()


def test_a_limit_is_repeated_for_some_seconds_at_most(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=0.1, seconds=2.0)

    def is_held() -> bool:
        return any(each.linear == 0.1 for each in robot.safety.latest().limit_sources)

    wait_until(is_held, "the limit")
    wait_until(lambda: not is_held(), "its end")
    limit.set(0.1, seconds=60)
    wait_until(is_held, "the limit again")
    limit.end()


def test_the_error_of_an_unknown_robot_names_the_others(stack: RunningStack) -> None:
    with (
        t2.connect("007", endpoint=stack.endpoint) as other,
        pytest.raises(t2.NoData, match="no robot 007 at this router, which has 001"),
    ):
        other.odometry.latest(timeout=0.2)


def test_an_unknown_source_is_told_so(robot: t2.Robot) -> None:
    with pytest.raises(t2.NotAllowed, match="it lists detector"):
        robot.limit("stranger", linear=0.1, seconds=1)
    with (
        pytest.raises(t2.NotAllowed, match=r"'stranger'.*safety\.sources"),
        robot.drive("stranger"),
    ):
        pass


def test_who_is_overruled_is_told_by_whom(robot: t2.Robot, stack: RunningStack) -> None:
    made: list[DriveSource] = []

    def declare(bus: Bus) -> None:
        made.append(DriveSource(bus, "teleop"))
        loop.post(lambda: loop.every(0.05, lambda _: made[0].request(0.0, 0.0)))

    with running(Loop()) as loop, robot.drive("nav") as drive:
        drive.velocity(0.05)
        with bus_on(stack.endpoint, loop, declare), pytest.raises(t2.Overruled) as overruled:
            drive.forward(5.0, speed=0.05)
    assert overruled.value.by == "teleop"


def test_an_obstacle_blocks_a_distance(robot: t2.Robot, stack: RunningStack) -> None:
    stack.control.do(Sonar(name="front", range=0.2))
    began_s = time.monotonic()
    try:
        with pytest.raises(t2.Blocked) as stopped, robot.drive("nav") as drive:
            drive.forward(1.0, patience=0.5)
    finally:
        stack.control.do(Sonar(name="front"))
    assert stopped.value.causes
    assert time.monotonic() - began_s >= 0.5


def test_invalid_numbers_are_refused(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        for move in (drive.velocity, drive.forward, drive.turn):
            for number in (math.nan, math.inf):
                with pytest.raises(ValueError, match="only finite"):
                    move(number)
        with pytest.raises(ValueError, match="speed must be positive"):
            drive.forward(1.0, speed=-0.3)
    with pytest.raises(ValueError, match="not negative"):
        robot.limit("detector", linear=-1.0, seconds=1)
    robot.led(channel=1, mode=1)


def test_an_error_ends_a_drive_for_good(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        robot.estop()
        wait_until(lambda: "estop" in robot.safety.latest().latched, "the latch")
        for _ in range(2):
            with pytest.raises(t2.Latched):
                wait_until(lambda: drive.check(), "the error")
        time.sleep(1.0)
        robot.reset()
        with pytest.raises(t2.Latched):
            drive.velocity(0.3)
    with pytest.raises(t2.Latched):
        drive.velocity(0.3)
    with robot.drive("nav") as drive:
        pass
    with pytest.raises(t2.T2Error, match="closed"):
        drive.velocity(0.3)


def test_a_source_has_one_drive_in_a_program(robot: t2.Robot) -> None:
    with (
        robot.drive("nav"),
        pytest.raises(t2.T2Error, match="is open in this program"),
        robot.drive("nav"),
    ):
        pass


def test_a_cancel_before_a_motion_ends_it(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.cancel()
        drive.check()  # of another thread: the cancel stays
        with pytest.raises(t2.T2Error, match="cancelled"):
            drive.forward(5.0)
        drive.forward(0.05)


def test_an_ended_limit_is_not_set(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=0.3, seconds=1)
    limit.end()
    limit.end()
    with pytest.raises(t2.T2Error, match="has ended"):
        limit.set(0.1, seconds=1)
