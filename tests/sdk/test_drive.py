"""Drives that are used in an unusual way: each call works or raises, and no source stays locked."""

import asyncio
import contextlib
import time
from functools import partial
from typing import Any

import numpy as np
import pytest

import t2
from tests.sdk.library_robot import blocked
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed


def await_motion(robot: t2.Robot) -> None:
    """Wait until the vehicle drives forward."""
    wait_until(lambda: robot.velocity.latest().linear > 0.02, "motion")


def test_a_number_of_numpy_drives_and_text_raises(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.velocity(np.float64(0.2), np.float64(0.0), seconds=np.float64(60.0))
        await_motion(robot)
        for text in ("0.2", None):
            number: Any = text
            with pytest.raises(TypeError):
                drive.velocity(number)
            with pytest.raises(TypeError):
                drive.turn(0.1, number)
        drive.check()
        drive.turn(np.float64(0.1), np.float64(0.5), np.float64(3.0))
    robot.set_pose(np.float64(0.5))


def test_an_unexpected_error_ends_a_drive_and_frees_its_source(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive._target = None  # type: ignore[assignment]
        wait_until(lambda: not drive.is_open, "the end of the drive")
        with pytest.raises(t2.T2Error, match="AttributeError"):
            drive.velocity(0.2)
    with robot.drive("nav") as drive:
        drive.velocity(0.2)
        await_motion(robot)


def test_a_protective_stop_is_raised_and_the_next_drive_sends_a_neutral_request(
    robot: t2.Robot,
) -> None:
    def drive_on() -> None:
        with robot.drive("nav") as drive:
            drive.velocity(0.05)
            await_motion(robot)
            robot.limit("detector", linear=0.0, seconds=0.5)
            wait_until(drive.check, "the stop")

    with pytest.raises(t2.Stopped) as stop:
        drive_on()
    assert {cause.name for cause in stop.value.causes} & {"limit_stop", "neutral"}
    wait_until(lambda: not blocked(robot), "the end of the stop")
    with robot.drive("nav") as drive:
        for _ in range(2):
            drive.velocity(0.2, seconds=1.0)
            await_motion(robot)
            time.sleep(2.0)  # longer than any lease


def test_a_drive_is_entered_once(robot: t2.Robot) -> None:
    drive = robot.drive("nav")
    with pytest.raises(t2.T2Error, match="not entered"):
        drive.velocity(0.2)
    with drive, pytest.raises(t2.T2Error, match="is open"), drive:
        pass
    with pytest.raises(t2.T2Error, match="is closed"), drive:
        pass
    with robot.drive("nav"):
        pass


def test_a_cancel_without_a_motion_ends_the_next_velocity(robot: t2.Robot) -> None:
    with robot.drive("nav") as drive:
        drive.cancel()
        with pytest.raises(t2.T2Error, match="cancelled"):
            drive.velocity(0.2)
        drive.velocity(0.2)
        await_motion(robot)


def test_a_motion_that_is_cancelled_twice_leaves_a_drive_that_works(
    robot: t2.Robot, stack: RunningStack
) -> None:
    async def main() -> None:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin, twin.drive("nav") as drive:
            motion = asyncio.create_task(drive.forward(20.0, speed=0.2))
            while (await twin.velocity.latest(timeout=5.0)).linear < 0.1:
                await asyncio.sleep(0.05)
            for _ in range(2):
                motion.cancel()
                await asyncio.sleep(0)
            with pytest.raises(asyncio.CancelledError):
                await motion
            drive.velocity(0.2)
            while (await twin.velocity.latest(timeout=5.0)).linear < 0.1:
                await asyncio.sleep(0.05)

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_two_simulated_robots_drive_in_one_program() -> None:
    def moves(robot: t2.Robot) -> bool:
        with contextlib.suppress(t2.Stopped), robot.drive("nav") as drive:
            drive.velocity(0.1)
            await_motion(robot)
            return True
        return False  # two stacks share two cores: a late frame stops a vehicle

    with t2.sim() as first, t2.sim() as second:
        for robot in (first, second):
            wait_until(partial(moves, robot), "motion")
