"""Connections on the real stack: names, keepalives, suspended programs and forks."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import t2
import t2.third_party
from tests.sdk.library_robot import blocked
from tests.sdk.test_drive import await_motion
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


def test_calls_and_limits_reach_the_real_stack(robot: t2.Robot) -> None:
    robot.limit("detector", linear=0.3, seconds=1).end()
    robot.set_pose(x=1.0)
    robot.led(channel=1, mode=1)
    wait_until(lambda: abs(robot.odometry.latest().x - 1.0) < 0.5, "the pose")


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


def test_a_suspended_program_is_told_so(stack: RunningStack, robot: t2.Robot) -> None:
    words = [sys.executable, "-c", SUSPENDED, stack.endpoint]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        await_motion(robot, 0.02)
        program.send_signal(signal.SIGSTOP)
        time.sleep(1.5)  # longer than HELD_S
        program.send_signal(signal.SIGCONT)
        out, _ = program.communicate(timeout=60)
    assert "Late: this program was held up for" in out


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
