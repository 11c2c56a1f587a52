"""The client library on the simulated stack, in simulated time: no router, no thread, no sleep.

``session`` stands for Zenoh, ``SimulatedTime`` for the clock. Whatever waits turns the stack, so a
lap takes some seconds and is the same each time.
"""

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

import cli.demo.lap
import t2
import t2.drive
import t2.publisher
import t2.robot
import t2.stream
from common.freshness import NS_PER_S
from common.settings import Vehicle
from sim.config import load_plan
from t2 import messages as m
from verification.search.bus import MS, Envelope, Subscription
from verification.search.stack import ASK_NS, Stack

ENCODE = msgspec.msgpack.encode
TICK_MS = 10


def raw(payload: bytes) -> SimpleNamespace:
    """Return a sample as Zenoh passes it."""
    return SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: payload))


class SimulatedStack(Stack):
    """The stack in a world, with the shipped settings of the vehicle.

    The calls of ``each_beat`` are made 20 times a second.
    """

    def __init__(self, world: str = "office") -> None:
        super().__init__(plan=load_plan(world, Vehicle()), step_ns=TICK_MS * MS)
        self.each_beat: list[Callable[[], object]] = []
        self.answers: list[bool] = []  # to resets

    def advance(self) -> None:
        """Turn for one tick."""
        self.run(TICK_MS)
        if self.net.now_ns % ASK_NS == 0:
            for call in self.each_beat.copy():
                call()


class SimulatedTime:
    """The functions of ``time``; sleeping turns the stack."""

    def __init__(self, stack: SimulatedStack) -> None:
        self._stack = stack

    def monotonic(self) -> float:
        return self._stack.net.now_ns / NS_PER_S

    def monotonic_ns(self) -> int:
        return self._stack.net.now_ns

    time_ns = monotonic_ns

    def sleep(self, seconds: float) -> None:
        self.wait_for(lambda: False, seconds)

    def wait_for(self, true: Callable[[], object], timeout: float) -> None:
        """Turn the stack until a condition is true, or for some seconds."""
        end_s = self.monotonic() + timeout
        while not true() and self.monotonic() < end_s:
            self._stack.advance()


class SimulatedCondition:
    """``threading.Condition`` of a program with one thread."""

    def __init__(self, time: SimulatedTime) -> None:
        self.wait_for = time.wait_for

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def notify_all(self) -> None: ...


class SimulatedThread:
    """The thread of a drive: its ticks are made by the stack, its end by ``join``."""

    def __init__(self, stack: SimulatedStack, target: Any) -> None:
        self._beats, self._end = stack.each_beat, target
        self._tick: Callable[[], None] = target.__self__._tick

    def start(self) -> None:
        self._beats.append(self._tick)

    def is_alive(self) -> bool:
        return self._tick in self._beats

    def join(self) -> None:
        self._beats.remove(self._tick)
        self._end()


class SimulatedSession:
    """The calls of a Zenoh session that the library makes."""

    info = SimpleNamespace(routers_zid=list)

    def __init__(self, stack: SimulatedStack) -> None:
        self._stack = stack
        self._process = stack.process("sdk")

    def declare_subscriber(self, key: str, handler: Callable[[Any], None]) -> object:
        def take(envelope: Envelope) -> None:
            handler(raw(ENCODE(envelope.message)))

        self._stack.net.subscribe(Subscription(self._process, key, take, depth=1))
        return object()

    def declare_publisher(self, key: str, **_: object) -> object:
        def put(payload: bytes) -> None:
            self._process.post(key, msgspec.msgpack.decode(payload, type=m.Drive))

        matching = SimpleNamespace(matching=True)
        return SimpleNamespace(put=put, matching_status=matching, undeclare=lambda: None)

    def get(self, key: str, payload: bytes, **_: object) -> list[SimpleNamespace]:
        """Reset."""
        caller = self._stack.call_reset(msgspec.msgpack.decode(payload, type=m.ResetRequest))
        self._stack.answers.append(bool(caller.done))
        if not caller.done:
            return [SimpleNamespace(ok=None, err=raw(caller.text.encode()))]
        return [SimpleNamespace(ok=raw(ENCODE(caller.answer)), err=None)]

    def close(self) -> None: ...


def simulated_robot(stack: SimulatedStack, patch: pytest.MonkeyPatch) -> t2.Robot:
    """Return the robot of a stack; the library and the demo run in its time."""
    time = SimulatedTime(stack)
    modules = (t2.drive, t2.publisher, t2.robot, t2.stream, cli.demo.lap)
    for module in modules:
        patch.setattr(module, "time", time)
    patch.setattr(
        t2.stream, "threading", SimpleNamespace(Condition=lambda: SimulatedCondition(time))
    )
    thread = SimpleNamespace(
        Event=threading.Event,
        Lock=threading.Lock,
        Thread=lambda target, **_: SimulatedThread(stack, target),
    )
    patch.setattr(t2.drive, "threading", thread)
    session: Any = SimulatedSession(stack)
    return t2.Robot(session, "001", "simulated")
