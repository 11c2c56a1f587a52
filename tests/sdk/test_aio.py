"""The twins for asyncio on the real stack: cancelled motions, iterations that end."""

import asyncio

import pytest

import t2
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed


def test_a_cancelled_motion_stops_the_vehicle(robot: t2.Robot, stack: RunningStack) -> None:
    async def main() -> None:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin, twin.drive("nav") as drive:
            motion = asyncio.create_task(drive.forward(20.0, speed=0.2))
            while (await twin.velocity.latest(timeout=5.0)).linear < 0.1:
                await asyncio.sleep(0.05)
            motion.cancel()
            with pytest.raises(asyncio.CancelledError):
                await motion
            while (await twin.velocity.latest(timeout=5.0)).linear > 0.02:
                await asyncio.sleep(0.05)
            await drive.turn(0.2)  # the drive goes on

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_a_cancelled_start_ends_the_drive(robot: t2.Robot, stack: RunningStack) -> None:
    async def main() -> None:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin:

            async def start() -> None:
                async with twin.drive("nav"):
                    pytest.fail("the drive started")

            starting = asyncio.create_task(start())
            await asyncio.sleep(0)
            starting.cancel()
            with pytest.raises(asyncio.CancelledError):
                await starting

    asyncio.run(asyncio.wait_for(main(), 60.0))
    wait_until(lambda: robot.safety.latest().source is None, "no source in control")


def test_a_latch_raises_in_the_task(robot: t2.Robot, stack: RunningStack) -> None:
    async def main() -> None:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin:
            with pytest.raises(t2.Latched) as stopped:
                async with twin.drive("nav") as drive:
                    await asyncio.gather(drive.forward(20.0, speed=0.1), twin.estop())
            assert [cause.name for cause in stopped.value.causes] == ["estop"]
            await twin.reset()

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_iterations_end_when_the_robot_closes(stack: RunningStack) -> None:
    async def count(robot: t2.AsyncRobot) -> int:
        seen = 0
        async for _ in robot.odometry:
            seen += 1
        return seen

    async def main() -> int:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin:
            counting = asyncio.create_task(count(twin))
            await twin.odometry.latest(timeout=5.0)
            await asyncio.sleep(0.5)
        return await counting

    assert asyncio.run(asyncio.wait_for(main(), 60.0)) > 0


def test_a_slow_reader_gets_the_newest_message(stack: RunningStack) -> None:
    async def main() -> tuple[int, int]:
        async with t2.aconnect("001", endpoint=stack.endpoint) as twin:
            poses = aiter(twin.odometry)
            first = await anext(poses)
            await asyncio.sleep(1.0)
            return first.seq, (await anext(poses)).seq

    first, newest = asyncio.run(asyncio.wait_for(main(), 60.0))
    assert newest - first > 2


def test_without_a_router_the_error_names_the_endpoint() -> None:
    async def main() -> None:
        with pytest.raises(t2.LinkError, match="no router answers at tcp"):
            async with t2.aconnect("001", endpoint="tcp/127.0.0.1:9"):
                pass

    asyncio.run(main())
