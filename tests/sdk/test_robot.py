"""The client library on the simulated stack, in simulated time: stops, releases and limits."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import t2
from sim.requests import Bumper
from t2.messages import LimitState
from tests.sdk.library_robot import blocked
from tests.sdk.test_drive import await_motion
from tests.simulated_robot import SimulatedStack
from verification.harness.waiting import wait_until
from verification.search.condition_books import IGNORED


@pytest.fixture
def robot(simulated: t2.Robot) -> t2.Robot:
    return simulated


@pytest.fixture
def stack(simulated_stack: SimulatedStack) -> SimulatedStack:
    return simulated_stack


@pytest.fixture
def pressed(robot: t2.Robot, stack: SimulatedStack) -> None:
    """Press the bumper while the vehicle drives forward, and wait for the latch."""
    with suppress(t2.Latched), robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=10)
        await_motion(robot)
        stack.vehicle.inject(Bumper(pressed=True))
        drive.forward(5.0, speed=0.2)
    wait_until(lambda: "contact" in robot.safety.latest().latched, "the contact")


@pytest.mark.usefixtures("pressed")
def test_a_release_creeps_until_the_bumper_is_free(robot: t2.Robot, stack: SimulatedStack) -> None:
    def free() -> None:
        wait_until(lambda: robot.velocity.latest().linear < -0.02, "creeping backward")
        stack.vehicle.inject(Bumper(pressed=False))

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
    freeing = stack.start(free)
    robot.release("backward", "teleop", timeout=30.0)
    freeing.join()
    assert not robot.bumper.latest().pressed
    assert robot.safety.latest().latched == ("contact",)
    wait_until(lambda: not blocked(robot), "a vehicle that may drive")
    robot.release("backward", "teleop")  # a free bumper needs none


def shown(robot: t2.Robot) -> LimitState:
    """Return the limit that safety's state shows."""
    states = robot.safety.latest().limit_sources
    return next(each for each in states if each.source == IGNORED)


def test_a_limit_slows_the_vehicle_down_for_its_seconds(
    robot: t2.Robot, stack: SimulatedStack
) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(0.3, seconds=10)
        await_motion(robot, 0.2)
        limit = robot.limit(IGNORED, np.float64(0.1), reason="person ahead", seconds=0.3)
        assert (shown(robot).linear, shown(robot).reason) == (0.1, "person ahead")
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
    stack.clock.sleep(1.2)  # longer than its lease: the valid limit is kept
    assert shown(robot).linear == 0.2
    for _ in range(2):
        limit.end()
    with pytest.raises(t2.T2Error, match="has ended"):
        limit.set(0.1, seconds=1)
    wait_until(lambda: shown(robot).linear is None, "the end of the limit")


def test_an_unexpected_error_ends_drive_and_limit_and_frees_their_sources(robot: t2.Robot) -> None:
    limit = robot.limit(IGNORED, linear=0.3, seconds=60)
    limit._message = None  # type: ignore[assignment]
    wait_until(lambda: limit.has_ended, "the end of the limit")
    robot.limit(IGNORED, linear=0.2, seconds=60).end()
    with robot.drive("nav") as drive:
        drive._target = None  # type: ignore[assignment]
        wait_until(lambda: not drive.is_open, "the end of the drive")
        with pytest.raises(t2.T2Error, match="AttributeError"):
            drive.velocity(0.2, seconds=10)
    with robot.drive("nav") as drive:
        drive.velocity(0.2, seconds=10)
        await_motion(robot)


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
