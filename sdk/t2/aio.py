"""Twins for asyncio: the same names, with ``await``, ``async for`` and ``async with``."""

import asyncio
from collections import deque
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
    """A ``Stream`` for asyncio; ``stream`` is the twin."""

    def __init__(self, stream: Stream[M]) -> None:
        self.stream = stream

    async def latest(self, timeout: float = 1.0) -> M:
        """Return the newest message as ``Stream.latest`` does. Raises ``NoData``.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         print((await robot.bumper.latest()).pressed)
        >>> asyncio.run(main())
        False
        """
        return await asyncio.to_thread(self.stream.latest, timeout)

    async def __aiter__(self) -> AsyncIterator[M]:
        """Yield each new message, never a backlog; end when the robot is closed.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         async for pose in robot.odometry:
        ...             return print(math.isfinite(pose.x))
        >>> asyncio.run(main())
        True
        """
        inbox: Inbox[M] = Inbox(self.stream.depth)
        with self.stream.reading(inbox):
            while not self.stream.closed:
                message = await inbox.next()
                if message is not None:
                    yield message


class Inbox(Generic[M]):
    """A bounded queue that Zenoh's threads fill and a task empties."""

    def __init__(self, depth: int) -> None:
        self._loop = asyncio.get_running_loop()
        self._queue: deque[M | None] = deque(maxlen=depth)
        self._filled = asyncio.Event()

    def append(self, message: M | None) -> None:
        """Add a message, from any thread; drop the oldest one when full."""
        self._queue.append(message)
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._filled.set)

    async def next(self) -> M | None:
        """Return the oldest message; None when the stream was closed."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        return self._queue.popleft()


class AsyncDrive:
    """A ``Drive`` for asyncio; a cancelled motion requests zero before the task goes on."""

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
        """Stop as ``Drive.stop`` does.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         async with robot.drive("nav") as drive:
        ...             drive.velocity(0.1)
        ...             await drive.stop()
        >>> asyncio.run(main())
        """
        self._drive.velocity(0.0)  # at once: a thread may not be free
        await self._wait(self._drive.stop)

    async def forward(self, distance: float, speed: float = 0.3, patience: float = 3.0) -> None:
        """Drive a distance in m as ``Drive.forward`` does.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         async with robot.drive("nav") as drive:
        ...             await drive.forward(0.1)
        >>> asyncio.run(main())
        """
        await self._wait(self._drive.forward, distance, speed, patience)

    async def turn(self, angle: float, speed: float = 0.5, patience: float = 3.0) -> None:
        """Turn by an angle in rad as ``Drive.turn`` does.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         async with robot.drive("nav") as drive:
        ...             await drive.turn(math.pi / 8)
        >>> asyncio.run(main())
        """
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
    """A ``Robot`` for asyncio, from ``aconnect``; ``robot`` is the twin."""

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
        """Return a drive as this source, for ``async with``; ``AsyncDrive`` has examples."""
        return AsyncDrive(self.robot.drive(source))

    async def limit(
        self,
        source: str,
        linear: float | None = None,
        angular: float | None = None,
        reason: str = "",
        *,
        seconds: float,
    ) -> SpeedLimit:
        """Cap the speed in m/s and rad/s as ``Robot.limit`` does.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         limit = await robot.limit("detector", linear=0.3, seconds=1)
        ...         limit.end()
        >>> asyncio.run(main())
        """
        return await asyncio.to_thread(
            self.robot.limit, source, linear, angular, reason, seconds=seconds
        )

    async def estop(self) -> None:
        """Stop and latch as ``Robot.estop`` does; a cancelled task does not end the attempts.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         await robot.estop()
        ...         await asyncio.sleep(1)  # look at the vehicle
        ...         await robot.reset()
        >>> asyncio.run(main())
        """
        self.robot.put_estop()  # at once: a thread may not be free
        await asyncio.to_thread(self.robot.estop)

    async def reset(self) -> m.ResetDone:
        """Reset as ``Robot.reset`` does; ``estop`` has an example."""
        return await asyncio.to_thread(self.robot.reset)

    async def release(self, direction: m.Direction, source: str, timeout: float = 5.0) -> None:
        """Move off a pressed bumper as ``Robot.release`` does.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         await robot.release("backward", "teleop")
        >>> asyncio.run(main())
        """
        await asyncio.to_thread(self.robot.release, direction, source, timeout)

    async def set_pose(self, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Set the pose of odometry in ``odom``: m, m, rad.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         await robot.set_pose(x=1.0)
        >>> asyncio.run(main())
        """
        await asyncio.to_thread(self.robot.set_pose, x, y, heading)

    async def led(self, channel: int, mode: int, **settings: int) -> None:
        """Set one lamp channel as ``Robot.led`` does.

        >>> async def main():
        ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
        ...         await robot.led(channel=1, mode=1)
        >>> asyncio.run(main())
        """
        await asyncio.to_thread(self.robot.led, channel, mode, **settings)
