"""Streams: the newest message of a topic, never a backlog."""

import inspect
import logging
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any, Generic, TypeVar

import msgspec
import zenoh

from t2.codec import decode
from t2.errors import Incompatible, LinkError, MessageError, NoData, T2Error
from t2.keys import HEALTH, ON_BOARD, ROOT, live_key
from t2.messages import VERSION, Message

M = TypeVar("M", bound=Message)

LIVE_S = 0.5  # for the list of robots
HEALTH_S = 2.0  # twice the period of health messages
CHECK_S = 0.1  # whether a subscription is closed
ADVICE = "is the stack running? `t2 doctor` on the robot or a laptop finds the reason"
AWAIT = "pass a plain function, or use `async for` in a task"
logger: logging.Logger = logging.getLogger(__name__)
CONNECTED = set[int]()  # this process, or the one that it was forked from, once it has connected


def now_s() -> float:
    """Return a monotonic time in s that goes on while the computer is suspended, if it can."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


def robots_of(session: zenoh.Session) -> list[str]:
    """Return the ids of the robots of which a service on board runs; laptops have some, too."""
    tokens = session.liveliness().get(live_key("*", "*", "*"), timeout=LIVE_S)
    keys = [str(it.ok.key_expr).split("/") for it in tokens if it.ok is not None]
    return sorted({key[2] for key in keys if key[4] in ON_BOARD})


class Versioned(msgspec.Struct):
    """What each version's message of health has."""

    version: str


def stack_version(session: zenoh.Session, robot: str) -> str:
    """Return the version of a robot's stack by its health messages; empty without any."""
    found = ""
    received = threading.Event()

    def on_sample(sample: zenoh.Sample) -> None:
        nonlocal found
        with suppress(msgspec.MsgspecError):
            found = msgspec.msgpack.decode(sample.payload.to_bytes(), type=Versioned).version
            received.set()

    with session.declare_subscriber(HEALTH.on(robot, service="safety"), on_sample):
        received.wait(HEALTH_S)
    return found


def check_process() -> None:
    """Raise ``LinkError`` in a fork: Zenoh has no threads there, so that it hangs or is mute."""
    if CONNECTED - {os.getpid()}:
        raise LinkError("no connection survives a fork: connect in the new process only")


def check_function(handle: object) -> None:
    """Raise ``TypeError`` for what cannot be called, and for what must be awaited."""
    if not callable(handle):
        raise TypeError(f"{handle!r} is no function")
    plain: Any = handle
    while isinstance(plain, partial):
        plain = plain.func
    for each in (plain, type(plain).__call__):
        if inspect.iscoroutinefunction(each) or inspect.isasyncgenfunction(each):
            raise TypeError(f"{plain!r} is a coroutine function, which nobody awaits; {AWAIT}")


def check_result(result: object) -> None:
    """Raise ``TypeError`` for what must be awaited, such as the result of a lambda."""
    if inspect.iscoroutine(result):
        result.close()
    if inspect.isawaitable(result) or inspect.isasyncgen(result):
        raise TypeError(f"the function returned {result!r}, which nobody awaits; {AWAIT}")


class Stream(Generic[M]):
    """The messages of a topic; subscribed on first use.

    ``for`` yields each new message until the robot is closed; ``depth`` messages wait for a slow
    reader, older ones are dropped and counted in ``dropped``. ``invalid`` counts messages that do
    not have the topic's type; the first one is logged.

    >>> robot.odometry.latest(timeout=1.0).epoch >= 0
    True
    >>> robot.odometry.age < 1.0
    True
    >>> for pose in robot.odometry:
    ...     print(math.hypot(pose.x, pose.y) < 100.0)
    ...     break
    True
    """

    def __init__(
        self, session: zenoh.Session, key: str, kind: type[M], what: str, depth: int = 1
    ) -> None:
        self.key: str = key
        self.invalid: int = 0
        self.dropped: int = 0
        self._session = session
        self._kind = kind
        self._what = what
        self.depth: int = depth
        self.closed: bool = False
        self._changed = threading.Condition()
        self._newest: M | None = None
        self._received_s = 0.0
        self._invalid_s = -math.inf
        self._queues: list[deque[M]] = []
        self._subscriber: Any = None

    @property
    def newest(self) -> M | None:
        """The newest message received; None before the first one, or before the first use."""
        return self._newest

    @property
    def age(self) -> float:
        """Time in s since the newest message was received; infinite before the first one."""
        return now_s() - self._received_s if self._newest else float("inf")

    def latest(self, timeout: float = 1.0) -> M:
        """Return the newest message, at most ``timeout`` s old; wait for it at most that long.

        Raises ``NoData``, and ``Incompatible`` when messages arrive that it cannot read.
        """
        self.open()
        with self._changed:
            self._changed.wait_for(lambda: self.closed or self.age <= timeout, timeout)
            if self._newest is not None and self.age <= timeout:
                return self._newest
        self.check()  # closed meanwhile
        if now_s() - self._invalid_s <= timeout:
            raise self._incompatible()
        raise NoData(f"no {self._what} within {timeout:g} s on {self.key}: {self._advice()}")

    def on(self, handle: Callable[[M], object]) -> "Subscription":
        """Call a function with the newest message, in a thread of its own; return the subscription.

        It ends with its ``close``, or with the robot. A slow function skips messages. Its
        exceptions are logged, and the next message is handled. Raises ``TypeError`` for a coroutine
        function: use ``async for``.
        """
        return Subscription(self, handle)

    def __iter__(self) -> Iterator[M]:
        with self.reading() as queue:
            while not self.closed:
                message = self.after(queue, 1.0)
                if message is not None:
                    yield message

    @contextmanager
    def reading(self) -> Iterator["deque[M]"]:
        """Yield a queue that receives each message during the context."""
        queue: deque[M] = deque(maxlen=self.depth)
        with self._changed:
            self._queues.append(queue)
        self.open()
        try:
            yield queue
        finally:
            with self._changed:  # by identity: two empty queues are equal
                self._queues = [each for each in self._queues if each is not queue]

    def after(self, queue: "deque[M]", timeout: float) -> M | None:
        """Return the next message of a queue; None after ``timeout`` s, or when closed."""
        with self._changed:
            self._changed.wait_for(lambda: queue or self.closed, timeout)
            return queue.popleft() if queue else None

    def check(self) -> None:
        """Raise ``LinkError`` after the robot's ``close``, and in a fork."""
        check_process()
        if self.closed:
            raise LinkError("the robot was closed; connect again")

    def open(self) -> None:
        """Subscribe, once."""
        self.check()
        with self._changed:
            if self._subscriber is None:
                self._subscriber = self._session.declare_subscriber(self.key, self._on_sample)

    def close(self) -> None:
        """End all iterations, before the robot closes."""
        with self._changed:
            self.closed = True
            self._changed.notify_all()

    def _incompatible(self) -> T2Error:
        """Return the error of a topic with messages that cannot be read."""
        found = f"{self.invalid} messages on {self.key} are not of this package's form"
        stack = stack_version(self._session, self.key[len(ROOT) + 1 :].partition("/")[0])
        if stack in ("", VERSION):
            return NoData(f"{found}: a foreign program may send them; see `t2 doctor`")
        return Incompatible(
            f"{found}: incompatible (stack {stack}, this package {VERSION}); install the package "
            "of the stack's version"
        )

    def _advice(self) -> str:
        """Return what to do about silence; another robot's name is a frequent reason."""
        mine = self.key[len(ROOT) + 1 :].partition("/")[0]
        names = robots_of(self._session)
        if not names or mine in names:
            return ADVICE
        return f"no robot {mine} at this router, which has {', '.join(names)}"

    def _on_sample(self, sample: zenoh.Sample) -> None:
        try:
            message = decode(sample.payload.to_bytes(), self._kind)
        except MessageError as error:
            self.invalid, self._invalid_s = self.invalid + 1, now_s()
            if self.invalid == 1:
                logger.warning("%s: %s", self.key, error)
            return
        with self._changed:
            self._newest, self._received_s = message, now_s()
            for queue in self._queues:
                self.dropped += len(queue) == self.depth
                queue.append(message)
            self._changed.notify_all()


class Subscription:
    """The calls of ``Stream.on``; use it in ``with``, or ``close`` it.

    >>> with robot.odometry.on(lambda pose: print(pose.x)):  # doctest: +SKIP
    ...     time.sleep(1)
    """

    def __init__(self, stream: Stream[M], handle: Callable[[M], object]) -> None:
        check_function(handle)
        self._closed = threading.Event()
        reading = ExitStack()
        queue = reading.enter_context(stream.reading())  # now: no message before the thread is lost

        def run() -> None:
            with reading:
                while not (self._closed.is_set() or stream.closed):
                    message = stream.after(queue, CHECK_S)
                    if message is None or self._closed.is_set():
                        continue
                    try:
                        check_result(handle(message))
                    except Exception:
                        logger.exception("handler of %s", stream.key)

        self._thread = threading.Thread(target=run, name=f"t2 {stream.key}", daemon=True)
        self._thread.start()

    def __enter__(self) -> "Subscription":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the calls; one that runs is waited for, unless it closes the subscription itself."""
        self._closed.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()
