"""Twins for asyncio: the same names, with ``await``, ``async for`` and ``async with``."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from contextvars import copy_context
from functools import partial, wraps
from pathlib import Path
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

from t2.connection import connect
from t2.drive import ATTENTION, Attention, Drive
from t2.messages import (
    Bumper,
    Direction,
    Event,
    Link,
    MapPose,
    Message,
    Mileage,
    Odometry,
    PatrolState,
    SafetyState,
    Switches,
    Ultrasonic,
    Velocity,
)
from t2.patrol import Patrol
from t2.robot import Robot
from t2.stream import Stream, Subscription

M = TypeVar("M", bound=Message)
P = ParamSpec("P")
R = TypeVar("R")

POLL_S = 0.01  # shorter than the period of each stream
RENEW_S = 0.1  # the sign of life of the event loop


@asynccontextmanager
async def aconnect(
    robot: str = "", *, endpoint: str = "", config: str | Path | None = None
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


Method = Callable[Concatenate[Any, P], R]
Coroutines = Callable[Concatenate[Any, P], Coroutine[Any, Any, R]]


def awaited(method: Method[P, R]) -> Callable[[object], Coroutines[P, R]]:
    """Return a decorator that makes a method of the twin ours: a thread runs it."""

    def decorate(_: object) -> Coroutines[P, R]:
        @wraps(method)
        async def run(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> R:
            result: R = await self.run(partial(method, self.twin, *args, **kwargs))
            return result

        return run

    return decorate


def at_once(method: Method[P, R]) -> Callable[[object], Method[P, R]]:
    """Return a decorator that makes a method of the twin ours: it returns at once."""

    def decorate(_: object) -> Method[P, R]:
        @wraps(method)
        def call(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> R:
            return method(self.twin, *args, **kwargs)

        return call

    return decorate


async def until_done(future: "asyncio.Future[Any]") -> None:
    """Wait for the end of a future, however often this task is cancelled."""
    while not future.done():
        with suppress(Exception, asyncio.CancelledError):
            await asyncio.shield(future)


async def attended(call: Callable[[], R], end: Callable[[], None]) -> R:
    """Wait for a motion that a thread runs; ``end`` it when this task is cancelled.

    While the event loop is blocked, the motion requests zero.
    """
    attention, context = Attention(), copy_context()
    context.run(ATTENTION.set, attention)
    # No task: the end of asyncio.run would cancel that, and the thread would go on.
    thread = asyncio.get_running_loop().run_in_executor(None, context.run, call)
    try:
        while not thread.done():
            attention.renew()
            await asyncio.wait([thread], timeout=RENEW_S)
    except asyncio.CancelledError:
        end()
        await until_done(thread)
        raise
    return thread.result()


class AsyncStream(Generic[M]):
    """A ``Stream`` for asyncio; ``twin`` is the stream itself.

    ``async for`` yields each new message, never a backlog, and ends when the robot is closed.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         async for pose in robot.odometry:
    ...             return print(math.isfinite(pose.x))
    >>> asyncio.run(main())
    True
    """

    def __init__(self, twin: Stream[M]) -> None:
        self.twin: Stream[M] = twin

    @property
    def newest(self) -> M | None:
        """The newest message received; None before the first one, or before the first use."""
        return self.twin.newest

    @property
    def age(self) -> float:
        """Time in s since the newest message was received; infinite before the first one."""
        return self.twin.age

    @property
    def invalid(self) -> int:
        """The number of messages that do not have the topic's type."""
        return self.twin.invalid

    @property
    def dropped(self) -> int:
        """The number of messages that slow readers have not read in time."""
        return self.twin.dropped

    async def latest(self, timeout: float = 1.0) -> M:
        """Return the newest message as ``Stream.latest`` does."""
        return await asyncio.to_thread(self.twin.latest, timeout)

    def on(self, handle: Callable[[M], object]) -> Subscription:
        """Call a plain function as ``Stream.on`` does, in a thread."""
        return self.twin.on(handle)

    async def __aiter__(self) -> AsyncIterator[M]:
        with self.twin.reading() as queue:
            while not self.twin.closed:
                if queue:
                    yield queue.popleft()
                else:
                    await asyncio.sleep(POLL_S)


class AsyncDrive:
    """A ``Drive`` for asyncio; a cancelled motion requests zero before the task goes on.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         async with robot.drive("nav") as drive:
    ...             pose = await drive.forward(0.1, on_stop="wait")
    ...             pose = await drive.turn(math.pi / 8)
    ...             drive.velocity(0.1)
    ...             await drive.stop()
    >>> asyncio.run(main())
    """

    def __init__(self, twin: Drive) -> None:
        self.twin: Drive = twin
        self.source: str = twin.source

    @property
    def is_open(self) -> bool:
        """Whether requests are sent, or will be."""
        return self.twin.is_open

    @property
    def obeyed(self) -> bool:
        """Whether the vehicle follows these requests now."""
        return self.twin.obeyed

    async def __aenter__(self) -> "AsyncDrive":
        try:
            await self.run(self.twin.__enter__)
        except asyncio.CancelledError:
            self.twin.end()  # at once: the task may be cancelled again
            await asyncio.to_thread(self.twin.close)
            raise
        return self

    async def __aexit__(self, *raised: Any) -> None:
        self.twin.end()  # at once: a thread may not be free
        await asyncio.to_thread(self.twin.__exit__, *raised)

    @at_once(Drive.velocity)
    def velocity(self) -> None: ...  # noqa: D102 - the twin's docstring

    @at_once(Drive.check)
    def check(self) -> None: ...  # noqa: D102

    @awaited(Drive.forward)
    def forward(self) -> None: ...  # noqa: D102

    @awaited(Drive.turn)
    def turn(self) -> None: ...  # noqa: D102

    @awaited(Drive.arc)
    def arc(self) -> None: ...  # noqa: D102

    @awaited(Drive.follow)
    def follow(self) -> None: ...  # noqa: D102

    @awaited(Drive.goto)
    def goto(self) -> None: ...  # noqa: D102

    async def stop(self) -> None:
        """Stop as ``Drive.stop`` does."""
        self.twin.velocity(0.0)  # at once: a thread may not be free
        await self.run(self.twin.stop)

    async def run(self, motion: Callable[[], R]) -> R:
        """Wait for a motion of the twin, and end it when this task is cancelled."""
        try:
            return await attended(motion, self.twin.cancel)
        except asyncio.CancelledError:
            self.twin.uncancel()  # the motion had ended by itself
            raise


class AsyncPatrol(AsyncStream[PatrolState]):
    """A ``Patrol`` for asyncio.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         print((await robot.patrol.latest(timeout=5.0)).state, await robot.patrol.routes())
    >>> asyncio.run(main())
    idle ()
    """

    twin: Patrol

    def __init__(self, twin: Patrol) -> None:
        super().__init__(twin)

    @awaited(Patrol.start)
    def start(self) -> None: ...  # noqa: D102

    @awaited(Patrol.depart)
    def depart(self) -> None: ...  # noqa: D102

    @awaited(Patrol.pause)
    def pause(self) -> None: ...  # noqa: D102

    @awaited(Patrol.resume)
    def resume(self) -> None: ...  # noqa: D102

    @awaited(Patrol.go_home)
    def go_home(self) -> None: ...  # noqa: D102

    @awaited(Patrol.abort)
    def abort(self) -> None: ...  # noqa: D102

    @awaited(Patrol.rounds)
    def rounds(self) -> None: ...  # noqa: D102

    @awaited(Patrol.round)
    def round(self) -> None: ...  # noqa: D102

    @awaited(Patrol.routes)
    def routes(self) -> None: ...  # noqa: D102

    @awaited(Patrol.route)
    def route(self) -> None: ...  # noqa: D102

    @awaited(Patrol.save)
    def save(self) -> None: ...  # noqa: D102

    @awaited(Patrol.delete)
    def delete(self) -> None: ...  # noqa: D102

    @awaited(Patrol.teach)
    def teach(self) -> None: ...  # noqa: D102

    @awaited(Patrol.station)
    def station(self) -> None: ...  # noqa: D102

    @awaited(Patrol.end)
    def end(self) -> None: ...  # noqa: D102

    @awaited(Patrol.cancel)
    def cancel(self) -> None: ...  # noqa: D102

    async def run(self, call: Callable[[], R]) -> R:
        """Wait for a call of the twin."""
        return await asyncio.to_thread(call)


class AsyncRobot:
    """A ``Robot`` for asyncio, from ``aconnect``; ``twin`` is the robot itself.

    Each stream is an ``AsyncStream``.

    >>> async def main():
    ...     async with t2.aconnect("001", endpoint=ENDPOINT) as robot:
    ...         await robot.set_pose(x=1.0)
    ...         await robot.estop()
    ...         await asyncio.sleep(1)  # look at the vehicle
    ...         await robot.reset()
    >>> asyncio.run(main())
    """

    def __init__(self, twin: Robot) -> None:
        self.twin: Robot = twin
        self.name: str = twin.name
        self.endpoint: str = twin.endpoint
        self.odometry: AsyncStream[Odometry] = AsyncStream(twin.odometry)
        self.localization: AsyncStream[MapPose] = AsyncStream(twin.localization)
        self.safety: AsyncStream[SafetyState] = AsyncStream(twin.safety)
        self.velocity: AsyncStream[Velocity] = AsyncStream(twin.velocity)
        self.mileage: AsyncStream[Mileage] = AsyncStream(twin.mileage)
        self.ultrasonic: AsyncStream[Ultrasonic] = AsyncStream(twin.ultrasonic)
        self.bumper: AsyncStream[Bumper] = AsyncStream(twin.bumper)
        self.switches: AsyncStream[Switches] = AsyncStream(twin.switches)
        self.link: AsyncStream[Link] = AsyncStream(twin.link)
        self.events: AsyncStream[Event] = AsyncStream(twin.events)
        self.patrol: AsyncPatrol = AsyncPatrol(twin.patrol)

    @property
    def version(self) -> Coroutine[Any, Any, str]:
        """The version of the robot's stack, as ``await robot.version``."""
        return self.run(lambda: self.twin.version)

    def drive(self, source: str) -> AsyncDrive:
        """Return a drive as this source, for ``async with``."""
        return AsyncDrive(self.twin.drive(source))

    @awaited(Robot.limit)
    def limit(self) -> None: ...  # noqa: D102

    @awaited(Robot.keepalive)
    def keepalive(self) -> None: ...  # noqa: D102

    @awaited(Robot.reset)
    def reset(self) -> None: ...  # noqa: D102

    async def release(self, direction: Direction, source: str, timeout: float = 5.0) -> None:
        """Move off a pressed bumper as ``Robot.release`` does; a cancelled task ends it."""
        ended = threading.Event()
        call = partial(self.twin.release, direction, source, timeout, ended)
        await attended(call, ended.set)

    @awaited(Robot.set_pose)
    def set_pose(self) -> None: ...  # noqa: D102

    @awaited(Robot.place)
    def place(self) -> None: ...  # noqa: D102

    @awaited(Robot.fix)
    def fix(self) -> None: ...  # noqa: D102

    async def led(self, channel: int, mode: int, **settings: int) -> None:
        """Set one lamp channel as ``Robot.led`` does."""
        await self.run(partial(self.twin.led, channel, mode, **settings))

    async def estop(self) -> None:
        """Stop and latch as ``Robot.estop`` does; a cancelled task does not end the attempts."""
        self.twin.put_estop()  # at once: a thread may not be free
        await asyncio.to_thread(self.twin.estop)

    async def run(self, call: Callable[[], R]) -> R:
        """Wait for a call of the twin."""
        return await asyncio.to_thread(call)
