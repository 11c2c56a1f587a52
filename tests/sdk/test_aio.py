"""The twins for asyncio on the real stack: cancelled motions, iterations that end."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

import t2
from sim.requests import Bumper
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

Run = Callable[[Callable[[t2.AsyncRobot], Awaitable[None]]], None]


@pytest.fixture
def run(robot: t2.Robot, stack: RunningStack) -> Run:
    """Return a function that runs a coroutine with a connection of its own."""

    def run(use: Callable[[t2.AsyncRobot], Awaitable[None]]) -> None:
        async def main() -> None:
            async with t2.aconnect("001", endpoint=stack.endpoint) as twin:
                await use(twin)

        asyncio.run(asyncio.wait_for(main(), 60.0))

    return run


async def await_motion(robot: t2.AsyncRobot) -> None:
    """Wait until the vehicle drives forward."""
    while (await robot.velocity.latest(timeout=5.0)).linear < 0.1:
        await asyncio.sleep(0.05)


def test_a_cancelled_motion_stops_the_vehicle_and_leaves_the_drive(run: Run) -> None:
    async def use(robot: t2.AsyncRobot) -> None:
        async with robot.drive("nav") as drive:
            for times in (1, 2):
                motion = asyncio.create_task(drive.forward(20.0, speed=0.2))
                await await_motion(robot)
                for _ in range(times):
                    motion.cancel()
                    await asyncio.sleep(0)
                with pytest.raises(asyncio.CancelledError):
                    await motion
                while (await robot.velocity.latest(timeout=5.0)).linear > 0.02:
                    await asyncio.sleep(0.05)

    run(use)


def test_a_cancelled_start_ends_the_drive(run: Run, robot: t2.Robot) -> None:
    async def use(twin: t2.AsyncRobot) -> None:
        async def start() -> None:
            async with twin.drive("nav"):
                pytest.fail("the drive started")

        starting = asyncio.create_task(start())
        await asyncio.sleep(0)
        starting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await starting

    run(use)
    wait_until(lambda: robot.safety.latest().source is None, "no source in control")


def test_a_cancelled_release_ends(run: Run, robot: t2.Robot, stack: RunningStack) -> None:
    async def use(twin: t2.AsyncRobot) -> None:
        release = asyncio.create_task(twin.release("backward", "teleop", timeout=60.0))
        while twin.safety.newest is None or twin.safety.newest.source != "teleop":
            await asyncio.sleep(0.05)
        release.cancel()
        with pytest.raises(asyncio.CancelledError):
            await release
        while (await twin.safety.latest(timeout=5.0)).source is not None:
            await asyncio.sleep(0.05)
        await asyncio.sleep(0.5)
        assert (await twin.safety.latest(timeout=5.0)).source is None

    stack.control.do(Bumper(pressed=True))
    try:
        wait_until(lambda: "contact" in robot.safety.latest().latched, "the contact")
        run(use)
    finally:
        stack.control.do(Bumper(pressed=False))


def test_a_latch_raises_in_the_task(run: Run) -> None:
    async def use(robot: t2.AsyncRobot) -> None:
        with pytest.raises(t2.Latched) as stopped:
            async with robot.drive("nav") as drive:
                await asyncio.gather(drive.forward(20.0, speed=0.1), robot.estop())
        assert [cause.name for cause in stopped.value.causes] == ["estop"]

    run(use)


def test_an_iteration_skips_a_backlog_and_ends_when_the_robot_closes(stack: RunningStack) -> None:
    async def main() -> list[int]:
        async with t2.aconnect("001", endpoint=stack.endpoint) as robot:
            poses = aiter(robot.odometry)
            first = await anext(poses)
            await asyncio.sleep(0.5)
            newest = await anext(poses)
        return [first.seq, newest.seq, *[pose.seq async for pose in poses]]

    first, newest = asyncio.run(asyncio.wait_for(main(), 60.0))
    assert newest - first > 2
