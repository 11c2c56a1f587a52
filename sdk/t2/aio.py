"""Twins for asyncio: the same names, with ``await``, ``async for`` and ``async with``."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, Generic, TypeVar

from t2 import messages as m
from t2.connection import connect
from t2.drive import Drive
from t2.limit import SpeedLimit
from t2.robot import Robot
from t2.stream import Stream

M = TypeVar("M", bound=m.Message)

POLL_S = 0.01  # shorter than the period of each stream


@asynccontextmanager
async def aconnect(
    robot: str = "001", *, endpoint: str = "", config: str | Path | None = None
) -> AsyncIterator["AsyncRobot"]:
    """Connect as ``connect`` does, for ``async with``. Raises ``LinkError``.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         print(await robot.safety.latest() is not None)
    >>> asyncio.run(main())
    True
    """
    opening = asyncio.create_task(
        asyncio.to_thread(connect, robot, endpoint=endpoint, config=config)
    )
    try:
        opened = await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close)
        raise
    try:
        yield AsyncRobot(opened)
    finally:
        await asyncio.shield(asyncio.to_thread(opened.close))


def _close(opening: "asyncio.Task[Robot]") -> None:
    if not opening.exception():
        opening.result().close()


class AsyncStream(Generic[M]):
    """A ``Stream`` for asyncio; ``stream`` is the twin.

    ``async for`` yields each new message, never a backlog, and ends when the robot is closed.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         async for pose in robot.odometry:
    ...             return print(math.isfinite(pose.x))
    >>> asyncio.run(main())
    True
    """

    def __init__(self, stream: Stream[M]) -> None:
        self.stream = stream

    async def latest(self, timeout: float = 1.0) -> M:
        """Return the newest message as ``Stream.latest`` does. Raises ``NoData``."""
        return await asyncio.to_thread(self.stream.latest, timeout)

    async def __aiter__(self) -> AsyncIterator[M]:
        with self.stream.reading() as queue:
            while not self.stream.closed:
                if queue:
                    yield queue.popleft()
                else:
                    await asyncio.sleep(POLL_S)


class AsyncDrive:
    """A ``Drive`` for asyncio; a cancelled motion requests zero before the task goes on.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         async with robot.drive("nav") as drive:
    ...             await drive.forward(0.1)
    ...             await drive.turn(math.pi / 8)
    ...             drive.velocity(0.1)
    ...             await drive.stop()
    >>> asyncio.run(main())
    """

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self.velocity, self.check = drive.velocity, drive.check  # they return at once

    async def __aenter__(self) -> "AsyncDrive":
        try:
            await self._wait(self._drive.__enter__)
        except asyncio.CancelledError:
            self._drive.end()  # at once: the task may be cancelled again
            await asyncio.to_thread(self._drive.close)
            raise
        return self

    async def __aexit__(self, *raised: Any) -> None:
        self._drive.end()  # at once: a thread may not be free
        await asyncio.to_thread(self._drive.__exit__, *raised)

    async def stop(self) -> None:
        """Stop as ``Drive.stop`` does."""
        self._drive.velocity(0.0)  # at once: a thread may not be free
        await self._wait(self._drive.stop)

    async def forward(self, distance: float, speed: float = 0.3, patience: float = 3.0) -> None:
        """Drive a distance in m as ``Drive.forward`` does."""
        await self._wait(self._drive.forward, distance, speed, patience)

    async def turn(self, angle: float, speed: float = 0.5, patience: float = 3.0) -> None:
        """Turn by an angle in rad as ``Drive.turn`` does."""
        await self._wait(self._drive.turn, angle, speed, patience)

    async def _wait(self, motion: Callable[..., object], *values: float) -> None:
        task = asyncio.create_task(asyncio.to_thread(motion, *values))
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError:
            self._drive.cancel()
            while not task.done():  # however often this task is cancelled
                with suppress(Exception, asyncio.CancelledError):
                    await asyncio.shield(task)
            self._drive.uncancel()  # the motion had ended by itself
            raise


class AsyncRobot:
    """A ``Robot`` for asyncio, from ``aconnect``; ``robot`` is the twin.

    Each stream is an ``AsyncStream``.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         await robot.set_pose(x=1.0)
    ...         await robot.estop()
    ...         await asyncio.sleep(1)  # look at the vehicle
    ...         await robot.reset()
    >>> asyncio.run(main())
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.odometry = AsyncStream(robot.odometry)
        self.safety = AsyncStream(robot.safety)
        self.velocity = AsyncStream(robot.velocity)
        self.mileage = AsyncStream(robot.mileage)
        self.ultrasonic = AsyncStream(robot.ultrasonic)
        self.bumper = AsyncStream(robot.bumper)
        self.switches = AsyncStream(robot.switches)
        self.link = AsyncStream(robot.link)
        self.events = AsyncStream(robot.events)

    def drive(self, source: str) -> AsyncDrive:
        """Return a drive as this source, for ``async with``."""
        return AsyncDrive(self.robot.drive(source))

    async def estop(self) -> None:
        """Stop and latch as ``Robot.estop`` does; a cancelled task does not end the attempts."""
        self.robot.put_estop()  # at once: a thread may not be free
        await asyncio.to_thread(self.robot.estop)

    async def limit(
        self,
        source: str,
        linear: float | None = None,
        angular: float | None = None,
        reason: str = "",
        *,
        seconds: float,
    ) -> SpeedLimit:
        """Cap the speed in m/s and rad/s as ``Robot.limit`` does."""
        return await asyncio.to_thread(
            self.robot.limit, source, linear, angular, reason, seconds=seconds
        )

    async def reset(self) -> m.ResetDone:
        """Reset as ``Robot.reset`` does."""
        return await asyncio.to_thread(self.robot.reset)

    async def release(self, direction: m.Direction, source: str, timeout: float = 5.0) -> None:
        """Move off a pressed bumper as ``Robot.release`` does."""
        await asyncio.to_thread(self.robot.release, direction, source, timeout)

    async def set_pose(self, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Set the pose of odometry in ``odom`` (m, m, rad) as ``Robot.set_pose`` does."""
        await asyncio.to_thread(self.robot.set_pose, x, y, heading)

    async def led(self, channel: int, mode: int, **settings: int) -> None:
        """Set one lamp channel as ``Robot.led`` does."""
        await asyncio.to_thread(self.robot.led, channel, mode, **settings)
