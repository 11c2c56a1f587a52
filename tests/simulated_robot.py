"""The client library on the simulated stack, in simulated time: no router, no thread, no sleep.

``session`` stands for Zenoh, ``SimulatedTime`` for the clock. Whatever waits turns the stack, so a
lap takes some seconds and is the same each time.
"""

import threading
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

import cli.demo.driver
import t2
import t2.drive
import t2.publisher
import t2.robot
import t2.stream
from common import messages as m
from common.freshness import NS_PER_S
from services.safety.inputs import DriveRequest, Hold, Reset
from t2.keys import TOPICS
from tests.simulated_stack import SimulatedStack

ENCODE = msgspec.msgpack.encode
ROOT = "t2/v1/001"


def raw(payload: bytes) -> SimpleNamespace:
    """Return a sample as Zenoh passes it."""
    return SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: payload))


class SimulatedTime:
    """The functions of ``time``; sleeping turns the stack."""

    def __init__(self, stack: SimulatedStack) -> None:
        self._stack = stack

    def monotonic(self) -> float:
        return self._stack.now_ns / NS_PER_S

    def monotonic_ns(self) -> int:
        return self._stack.now_ns

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
        self._subscribers: dict[str, Callable[[Any], None]] = {}
        self._seqs: Counter[str] = Counter()
        stack.on_message = self._publish

    def declare_subscriber(self, key: str, handler: Callable[[Any], None]) -> object:
        self._subscribers[key] = handler
        return object()

    def declare_publisher(self, key: str, **_: object) -> object:
        source = key.rpartition("/")[2]
        return SimpleNamespace(
            put=lambda payload: self._drive(source, payload),
            matching_status=SimpleNamespace(matching=True),
            undeclare=lambda: None,
        )

    def get(self, key: str, payload: bytes, **_: object) -> list[SimpleNamespace]:
        """Call safety, as its service does."""
        event: Reset | Hold
        if key.endswith("reset"):
            reset = msgspec.msgpack.decode(payload, type=m.ResetRequest)
            event = Reset(reset.echo, reset.causes)
        else:
            hold = msgspec.msgpack.decode(payload, type=m.ReleaseRequest)
            event = Hold(hold.held, hold.direction, hold.echo)
        reply = self._stack.decide(event)
        assert reply is not None
        if not reply.done:
            return [SimpleNamespace(ok=None, err=raw(reply.text.encode()))]
        beat = self._stack.heartbeat + 1
        done = m.ResetDone(text=reply.text, heartbeat=beat, cleared=reply.cleared)
        return [SimpleNamespace(ok=raw(ENCODE(done)), err=None)]

    def close(self) -> None: ...

    def _publish(self, name: str, message: m.Message) -> None:
        handler = self._subscribers.get(f"{ROOT}/{TOPICS[name][0]}") if name in TOPICS else None
        if handler is not None:
            self._seqs[name] += 1
            handler(raw(ENCODE(msgspec.structs.replace(message, seq=self._seqs[name]))))

    def _drive(self, source: str, payload: bytes) -> None:
        request = msgspec.msgpack.decode(payload, type=m.Drive)
        self._stack.decide(DriveRequest(source, request, self._stack.now_ns))


def simulated_robot(stack: SimulatedStack, patch: pytest.MonkeyPatch) -> t2.Robot:
    """Return the robot of a stack; the library and the demo run in its time."""
    time = SimulatedTime(stack)
    modules = (t2.drive, t2.publisher, t2.robot, t2.stream, cli.demo.driver, cli.demo.record)
    for module in modules:
        patch.setattr(module, "time", time)
    patch.setattr(
        t2.stream, "threading", SimpleNamespace(Condition=lambda: SimulatedCondition(time))
    )
    thread = SimpleNamespace(
        Event=threading.Event,
        Thread=lambda target, **_: SimulatedThread(stack, target),
    )
    patch.setattr(t2.drive, "threading", thread)
    session: Any = SimulatedSession(stack)
    return t2.Robot(session, "001", "simulated")
