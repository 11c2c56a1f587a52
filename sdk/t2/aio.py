"""Twins for asyncio: the same names, with ``await``, ``async for`` and ``async with``."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

from t2.connection import connect
from t2.drive import Drive
from t2.messages import Message
from t2.robot import Robot
from t2.stream import Stream

M = TypeVar("M", bound=Message)
P = ParamSpec("P")
R = TypeVar("R")

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


def awaited(call: Callable[P, R]) -> Callable[P, Coroutine[Any, Any, R]]:
    """Return a call as a coroutine function, which waits for it in a thread."""

    @wraps(call)
    async def run(*args: P.args, **kwargs: P.kwargs) -> R:
        return await asyncio.to_thread(call, *args, **kwargs)

    return run


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
        self.key = stream.key
        self.latest = awaited(stream.latest)
        self.on = stream.on  # the function is called in a thread

    @property
    def newest(self) -> M | None:
        """The newest message received; None before the first one, or before the first use."""
        return self.stream.newest

    @property
    def age(self) -> float:
        """Time in s since the newest message was received; infinite before the first one."""
        return self.stream.age

    @property
    def invalid(self) -> int:
        """The number of messages that do not have the topic's type."""
        return self.stream.invalid

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
        self.source = drive.source
        # They return at once.
        self.velocity, self.check = drive.velocity, drive.check
        self.cancel, self.uncancel = drive.cancel, drive.uncancel
        self.forward, self.turn = self._motion(drive.forward), self._motion(drive.turn)
        self.arc, self.follow = self._motion(drive.arc), self._motion(drive.follow)
        self.goto = self._motion(drive.goto)

    @property
    def is_open(self) -> bool:
        """Whether requests are sent, or will be."""
        return self._drive.is_open

    @property
    def obeyed(self) -> bool:
        """Whether the vehicle follows these requests now."""
        return self._drive.obeyed

    async def __aenter__(self) -> "AsyncDrive":
        try:
            await self._motion(self._drive.__enter__)()
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
        await self._motion(self._drive.stop)()

    def _motion(self, motion: Callable[P, R]) -> Callable[P, Coroutine[Any, Any, R]]:
        """Return a motion as a coroutine function that ends it when it is cancelled."""

        @wraps(motion)
        async def run(*args: P.args, **kwargs: P.kwargs) -> R:
            task = asyncio.create_task(asyncio.to_thread(motion, *args, **kwargs))
            try:
                return await asyncio.shield(task)
            except asyncio.CancelledError:
                self._drive.cancel()
                while not task.done():  # however often this task is cancelled
                    with suppress(Exception, asyncio.CancelledError):
                        await asyncio.shield(task)
                self._drive.uncancel()  # the motion had ended by itself
                raise

        return run


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
        self.name, self.endpoint = robot.name, robot.endpoint
        self.odometry = AsyncStream(robot.odometry)
        self.safety = AsyncStream(robot.safety)
        self.velocity = AsyncStream(robot.velocity)
        self.mileage = AsyncStream(robot.mileage)
        self.ultrasonic = AsyncStream(robot.ultrasonic)
        self.bumper = AsyncStream(robot.bumper)
        self.switches = AsyncStream(robot.switches)
        self.link = AsyncStream(robot.link)
        self.events = AsyncStream(robot.events)
        self.close = awaited(robot.close)
        self.limit = awaited(robot.limit)
        self.keepalive = awaited(robot.keepalive)
        self.reset = awaited(robot.reset)
        self.release = awaited(robot.release)
        self.set_pose = awaited(robot.set_pose)
        self.led = awaited(robot.led)

    def drive(self, source: str) -> AsyncDrive:
        """Return a drive as this source, for ``async with``."""
        return AsyncDrive(self.robot.drive(source))

    async def estop(self) -> None:
        """Stop and latch as ``Robot.estop`` does; a cancelled task does not end the attempts."""
        self.robot.put_estop()  # at once: a thread may not be free
        await asyncio.to_thread(self.robot.estop)
