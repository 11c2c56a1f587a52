"""The client library on the real stack: drives, limits, stops, resets and forks."""

import math
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import t2
import t2.client
import t2.drive
import t2.third_party
from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from sim.requests import Bumper, Sonar
from t2.drive import is_blocked
from t2.messages import Odometry
from t2.motion import Straight
from tests.sdk.library_robot import blocked
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

FORK = """
import os, signal, sys, t2

def forked(use):
    child = os.fork()
    if not child:
        signal.alarm(20)
        use()
        os._exit(2)
    assert os.waitpid(child, 0)[1] == 0

def drive():
    with t2.connect("001", endpoint=sys.argv[1]) as robot, robot.drive("nav") as drive:
        print(robot.safety.latest().source, drive._publisher.boot, flush=True)
        os._exit(0)

def fails(use):
    def run():
        try:
            use()
        except t2.LinkError as error:
            os._exit(0 if "fork" in str(error) else 1)
    return run

for _ in range(2):
    forked(drive)
with t2.connect("001", endpoint=sys.argv[1]) as robot, robot.drive("nav") as drive:
    for use in (
        lambda: t2.connect("001", endpoint=sys.argv[1]), lambda: drive.velocity(0.1),
        lambda: robot.drive("web"), robot.safety.latest, lambda: robot.led(channel=1, mode=1),
        robot.estop, robot.reset, robot.close, lambda: robot.limit("detector", seconds=1),
    ):
        forked(fails(use))
    drive.turn(0.1)
"""


SUSPENDED = """
import sys, t2
with t2.connect("001", endpoint=sys.argv[1]) as robot, robot.drive("nav") as drive:
    try:
        drive.forward(5.0, speed=0.05)
    except t2.T2Error as error:
        print(f"{type(error).__name__}: {error}")
"""
HoldUp = Callable[[Callable[[], object]], None]


def await_motion(robot: t2.Robot, least: float = 0.1) -> None:
    """Wait until the vehicle drives forward."""
    wait_until(lambda: robot.velocity.latest().linear > least, "motion")


def test_a_velocity_ends_by_itself_or_with_the_drive(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(np.float64(0.2), seconds=np.float64(0.6))
        await_motion(robot)
        wait_until(lambda: robot.velocity.latest().linear < 0.02, "the end of the velocity")
        drive.velocity(0.2, seconds=10)
        await_motion(robot)
    wait_until(lambda: robot.velocity.latest().linear < 0.02, "the end of the drive")


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
        robot.limit("detector", linear=-1.0, seconds=1)
    call: Any = robot.limit
    with pytest.raises(TypeError, match="seconds"):
        call("detector", linear=0.3)


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


def await_standstill(robot: t2.Robot) -> None:
    wait_until(lambda: abs(robot.velocity.latest().linear) < 0.02, "standstill")


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
        limit = robot.limit("detector", linear=0.0, seconds=60)
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
    with pytest.raises(t2.Refused, match="Nothing is latched"):
        robot.reset()


@pytest.fixture
def pressed(robot: t2.Robot, stack: RunningStack) -> Iterator[None]:
    """Press the bumper while the vehicle drives forward, and wait for the latch."""
    try:
        with suppress(t2.Latched), robot.drive("nav") as drive:
            drive.velocity(0.2, seconds=10)
            await_motion(robot)
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

    with pytest.raises(t2.Refused, match="bumper"):
        robot.reset()
    with pytest.raises(t2.Refused, match="operator"):
        robot.release("forward", "nav", timeout=30.0)
    with pytest.raises(t2.NotAllowed, match=r"'stranger'.*safety\.sources"):
        robot.release("forward", "stranger", timeout=30.0)
    word: Any = "up"
    with pytest.raises(ValueError, match="'up' is not one of forward, backward"):
        robot.release(word, "teleop")
    with pytest.raises(t2.NotConfirmed, match=r"still pressed after 0\.\d s"):
        robot.release("backward", "teleop", timeout=0.3)
    freeing = threading.Thread(target=free)
    freeing.start()
    robot.release("backward", "teleop", timeout=30.0)
    freeing.join()
    assert not robot.bumper.latest().pressed
    assert robot.safety.latest().latched == ("contact",)
    wait_until(lambda: not blocked(robot), "a vehicle that may drive")
    robot.release("backward", "teleop")  # a free bumper needs none


def cap(robot: t2.Robot) -> float | None:
    """Return the cap that safety's state shows."""
    (limit,) = robot.safety.latest().limit_sources
    return limit.linear


def test_a_limit_slows_the_vehicle_down_for_its_seconds(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.3, seconds=10)
        await_motion(robot, 0.2)
        limit = robot.limit("detector", np.float64(0.1), reason="person ahead", seconds=0.3)
        (shown,) = robot.safety.latest().limit_sources
        assert (shown.linear, shown.reason) == (0.1, "person ahead")
        wait_until(lambda: robot.velocity.latest().linear < 0.15, "slow")

        def is_fast() -> bool:
            drive.check()
            return robot.velocity.latest().linear > 0.2

        wait_until(is_fast, "the end of the limit")
    limit.set(0.2, seconds=60)
    text: Any = "0.2"
    for error, linear, reason in ((TypeError, text, ""), (UnicodeError, 0.1, "\ud800")):
        with pytest.raises(error):
            limit.set(linear, reason=reason, seconds=60)
    time.sleep(1.2)  # longer than its lease: the valid limit is kept
    assert cap(robot) == 0.2
    for _ in range(2):
        limit.end()
    with pytest.raises(t2.T2Error, match="has ended"):
        limit.set(0.1, seconds=1)
    wait_until(lambda: cap(robot) is None, "the end of the limit")


def test_an_unexpected_error_ends_drive_and_limit_and_frees_their_sources(robot: t2.Robot) -> None:
    limit = robot.limit("detector", linear=0.3, seconds=60)
    limit._message = None  # type: ignore[assignment]
    wait_until(lambda: limit.has_ended, "the end of the limit")
    robot.limit("detector", linear=0.2, seconds=60).end()
    with robot.drive("nav") as drive:
        drive._target = None  # type: ignore[assignment]
        wait_until(lambda: not drive.is_open, "the end of the drive")
        with pytest.raises(t2.T2Error, match="AttributeError"):
            drive.velocity(0.2, seconds=10)
    with robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=10)
        await_motion(robot)


def test_unknown_names_are_refused_with_the_known_ones(
    robot: t2.Robot, stack: RunningStack
) -> None:
    with (
        t2.connect("007", endpoint=stack.endpoint) as other,
        pytest.raises(t2.NoData, match="no robot 007 at this router, which has 001"),
    ):
        other.odometry.latest(timeout=0.2)
    with pytest.raises(t2.NotAllowed, match="it lists detector"):
        robot.limit("stranger", linear=0.1, seconds=1)
    with (
        pytest.raises(t2.NotAllowed, match=r"'stranger'.*safety\.sources \(.*nav"),
        robot.drive("stranger"),
    ):
        pass


@pytest.mark.parametrize("name", ["", "*", "a/b", "Nav"])
def test_what_cannot_be_a_source_is_refused(robot: t2.Robot, name: str) -> None:
    for use in (
        lambda: robot.drive(name),
        lambda: robot.limit(name, seconds=1),
        lambda: robot.keepalive(name, seconds=1),
        lambda: robot.release("forward", name),
    ):
        with pytest.raises(t2.NotAllowed, match="cannot be a source"):
            use()


def test_a_closed_robot_is_named(stack: RunningStack) -> None:
    with t2.connect("001", endpoint=stack.endpoint) as robot:
        robot.odometry.latest(timeout=20.0)
        drive = robot.drive("nav")
    with pytest.raises(t2.T2Error, match="is closed"), drive:
        pass
    for use in (
        robot.estop,
        robot.reset,
        robot.set_pose,
        lambda: robot.led(channel=1, mode=1),
        lambda: robot.drive("nav"),
        lambda: robot.limit("detector", seconds=1),
        lambda: robot.keepalive("pendant", seconds=1),
        lambda: robot.release("forward", "teleop"),
        robot.odometry.latest,
        lambda: robot.odometry.on(print),
        lambda: list(robot.odometry),
    ):
        with pytest.raises(t2.LinkError, match="was closed"):
            use()
    robot.close()


def test_another_source_of_higher_priority_overrules(robot: t2.Robot, stack: RunningStack) -> None:
    made: list[DriveSource] = []

    def declare(bus: Bus) -> None:
        made.append(DriveSource(bus, "teleop"))
        loop.post(lambda: loop.every(0.05, lambda _: made[0].request(0.0, 0.0)))

    with running(Loop()) as loop, robot.drive("nav") as drive:
        drive.velocity(0.05, seconds=10)
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
    assert stopped.value.left == pytest.approx(1.0, abs=0.1)
    assert stopped.value.unit == "m"
    assert re.search(r"Left of the motion: \d\.\d\d m\.$", str(stopped.value))
    assert time.monotonic() - began_s >= 0.5


def test_a_motion_that_waits_goes_on_when_the_obstacle_is_gone(
    robot: t2.Robot, stack: RunningStack
) -> None:
    def go_away() -> None:
        wait_until(lambda: drive.is_open and is_blocked(robot.safety.latest()), "the obstacle")
        time.sleep(1.0)  # longer than the patience
        stack.control.do(Sonar(name="front"))

    stack.control.do(Sonar(name="front", range=0.2))
    start = robot.odometry.latest()
    try:
        with robot.drive("nav") as drive:
            going = threading.Thread(target=go_away)
            going.start()
            end = drive.forward(0.3, patience=0.6, on_stop="wait")
            going.join()
    finally:
        stack.control.do(Sonar(name="front"))
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


def test_a_pose_that_is_set_ends_a_motion(robot: t2.Robot) -> None:
    def set_pose() -> None:
        await_motion(robot, 0.02)
        robot.set_pose(np.float64(0.5))

    setting = threading.Thread(target=set_pose)
    setting.start()
    with pytest.raises(t2.PoseSet), robot.drive("nav") as drive:
        drive.forward(5.0, speed=0.05)
    setting.join()


def test_a_suspended_program_is_told_so(stack: RunningStack, robot: t2.Robot) -> None:
    words = [sys.executable, "-c", SUSPENDED, stack.endpoint]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        await_motion(robot, 0.02)
        program.send_signal(signal.SIGSTOP)
        time.sleep(1.5)  # longer than HELD_S
        program.send_signal(signal.SIGCONT)
        out, _ = program.communicate(timeout=60)
    assert "Late: this program was held up for" in out


def test_a_protective_stop_is_raised_and_the_next_drive_sends_a_neutral_request(
    robot: t2.Robot,
) -> None:
    def drive_on() -> None:
        with robot.drive("nav") as drive:
            drive.velocity(0.05, seconds=10)
            await_motion(robot, 0.02)
            robot.limit("detector", linear=0.0, seconds=0.5)
            wait_until(drive.check, "the stop")

    with pytest.raises(t2.Stopped) as stop:
        drive_on()
    assert {cause.name for cause in stop.value.causes} & {"limit_stop", "neutral"}
    wait_until(lambda: not blocked(robot), "a vehicle that may drive")
    with robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=10)
        await_motion(robot)


def test_a_motion_waits_for_the_end_of_a_protective_stop(robot: t2.Robot) -> None:
    start = robot.odometry.latest()
    stopped: list[bool] = []

    def stop_for_a_while() -> None:
        await_motion(robot)
        limit = robot.limit("detector", linear=0.0, seconds=60)
        wait_until(lambda: abs(robot.velocity.latest().linear) < 0.02, "standstill")
        stopped.append(drive.obeyed)
        time.sleep(0.5)
        limit.set(None, seconds=60)

    with robot.drive("nav") as drive:
        stopping = threading.Thread(target=stop_for_a_while)
        stopping.start()
        pose = drive.forward(0.6, patience=0.3, on_stop="wait")
        stopping.join()
        assert stopped == [False]
        assert math.dist((start.x, start.y), (pose.x, pose.y)) == pytest.approx(0.6, abs=0.1)
        drive.velocity(0.1, seconds=10, on_stop="wait")
        wait_until(lambda: drive.obeyed, "an obeyed request")
        robot.limit("detector", linear=0.0, seconds=60)
        wait_until(lambda: not drive.obeyed, "the stop")
        drive.check()
        with pytest.raises(t2.Stopped):
            drive.velocity(0.1, seconds=10)
    robot.limit("detector", seconds=0.1).end()


def test_the_wait_for_the_end_of_a_stop_has_an_end(
    robot: t2.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(t2.drive, "WAIT_S", 0.5)
    with robot.drive("nav") as drive:
        drive.velocity(0.1, seconds=10, on_stop="wait")
        limit = robot.limit("detector", linear=0.0, seconds=60)
        with pytest.raises(t2.Stopped):
            wait_until(drive.check, "the end of the wait")
        limit.end()


PENDANT = 'safety.limits.pendant={lease = 1.0, silence = "latch"}'


def test_a_keepalive_is_confirmed_and_its_end_latches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (
        running_stack(tmp_path, sets=[PENDANT]) as stack,
        t2.connect("001", endpoint=stack.endpoint) as robot,
    ):
        robot.safety.latest(timeout=20.0)
        with pytest.raises(t2.NotAllowed, match="it lists pendant"):
            robot.keepalive("other", seconds=1)
        pendant = robot.keepalive("pendant", seconds=60)
        (shown,) = robot.safety.latest().limit_sources
        assert not shown.silent
        assert robot.keepalive("pendant", seconds=60) is pendant
        wait_until(lambda: not blocked(robot), "a vehicle that may drive")
        monkeypatch.setattr(t2.third_party, "SHOWN_S", 0.0)
        with pytest.raises(t2.NotAllowed, match="does not show the keepalive of 'pendant'"):
            pendant.renew(seconds=60)  # what raises is not repeated
        wait_until(lambda: robot.safety.latest().latched == ("estop_keepalive",), "the latch")


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


def test_forks_are_publishers_of_their_own_and_inherit_no_connection(
    robot: t2.Robot, stack: RunningStack
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORK, stack.endpoint],
        capture_output=True, text=True, timeout=90, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    first, second = (line.split() for line in done.stdout.splitlines())
    assert first[0] == second[0] == "nav"
    assert first[1] != second[1]


@pytest.mark.campaign
def test_two_simulated_robots_drive_in_one_program() -> None:
    with t2.sim() as first, t2.sim() as second:
        for robot in (first, second):
            with robot.drive("nav") as drive:
                drive.velocity(0.2, seconds=10)
                await_motion(robot)
