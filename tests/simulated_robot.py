"""The client library on the simulated stack, in simulated time: no router, no sleep.

``SimulatedSession`` stands for Zenoh, ``SimulatedTime`` for ``time`` and ``threading``. Threads run
one at a time, and time passes only when all of them wait: a lap takes some seconds and is the same
each time.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import msgspec

import cli.demo.lap
import t2
import t2.drive
import t2.publisher
import t2.robot
import t2.stream
import t2.third_party
import verification.harness.waiting
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.localization.config import FixSource, Localization, LocalizationConfig
from services.localization.localization import LocalizationService
from services.patrol.config import Patrol, PatrolConfig
from services.patrol.patrol import PatrolService
from sim.config import load_plan
from t2 import keys
from t2 import messages as m
from t2.robot import CALL_S
from verification.search.bus import MS, ROBOT, Caller, Envelope, Subscription, matches
from verification.search.stack import Stack

ENCODE = msgspec.msgpack.encode
TICK_MS = 10
TAGS = Localization(sources={"tags": FixSource()})
CALLS = {
    call.on(ROBOT): call
    for call in (
        keys.RESET, keys.SET_POSE, keys.SET_LED, keys.PLACE,
        keys.TEACH, keys.ROUTES, keys.ROUND, keys.ROUNDS,
    )
}  # fmt: skip
MODULES = (
    cli.demo.lap, t2.drive, t2.publisher, t2.robot, t2.stream, t2.third_party,
    verification.harness.waiting,
)  # fmt: skip


def raw(payload: bytes) -> SimpleNamespace:
    """Return a sample as Zenoh passes it."""
    return SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: payload))


class Turn:
    """A thread that waits for its turn."""

    def __init__(self, true: Callable[[], object], end_s: float) -> None:
        self.true, self.end_s = true, end_s
        self.granted = threading.Event()


class SimulatedTime:
    """The functions of ``time``, and the scheduler of the threads.

    A thread that waits grants the turn to the first one that has waited long enough. When there is
    none, the stack advances.
    """

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._turns: list[Turn] = []

    def monotonic(self) -> float:
        return self._stack.net.now_ns / NS_PER_S

    def monotonic_ns(self) -> int:
        return self._stack.net.now_ns

    time_ns = monotonic_ns

    def sleep(self, seconds: float) -> None:
        self.wait_for(lambda: False, seconds)

    def wait_for(self, true: Callable[[], object], timeout: float = float("inf")) -> object:
        """Wait until a condition is true, or for some seconds; return the condition."""
        if not (found := true()):
            turn = self.queue(true, self.monotonic() + timeout)
            self.grant()
            turn.granted.wait()
            found = true()
        return found

    def queue(self, true: Callable[[], object], end_s: float) -> Turn:
        """Append a turn for this time or condition."""
        turn = Turn(true, end_s)
        self._turns.append(turn)
        return turn

    def reorder(self, step: int) -> None:
        """Keep the order of the threads that wait (1), or reverse it (-1)."""
        self._turns = self._turns[::step]

    def grant(self) -> None:
        """Grant the next turn."""
        while True:
            for turn in self._turns:
                if self.monotonic() >= turn.end_s or turn.true():
                    self._turns.remove(turn)
                    turn.granted.set()
                    return
            self._stack.run(TICK_MS)


class SimulatedThread:
    """``threading.Thread``."""

    def __init__(self, time: SimulatedTime, target: Callable[[], object]) -> None:
        self.ident: int | None = None
        self._time, self._target = time, target
        self._alive = False

    def start(self) -> None:
        self.ident, self._alive = 1, True
        turn = self._time.queue(lambda: True, 0.0)

        def run() -> None:
            turn.granted.wait()
            try:
                self._target()
            finally:
                self._alive = False
                self._time.grant()

        threading.Thread(target=run, daemon=True).start()

    def is_alive(self) -> bool:
        return self._alive

    def join(self) -> None:
        self._time.wait_for(lambda: not self._alive)


class SimulatedEvent(threading.Event):
    """``threading.Event``."""

    def __init__(self, time: SimulatedTime) -> None:
        super().__init__()
        self._time = time

    def wait(self, timeout: float | None = None) -> bool:
        self._time.wait_for(self.is_set, float("inf") if timeout is None else timeout)
        return self.is_set()


class SimulatedCondition:
    """``threading.Condition``; it excludes nobody: one thread runs at a time."""

    def __init__(self, time: SimulatedTime) -> None:
        self.wait_for = time.wait_for

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def notify_all(self) -> None: ...


class SimulatedStack(Stack):
    """The stack in a world, with the shipped settings of the vehicle."""

    def __init__(self, world: str = "office", folder: Path | None = None) -> None:
        """With a ``folder`` of its own patrol runs, too."""
        super().__init__(plan=load_plan(world, Vehicle()), step_ns=TICK_MS * MS)
        self.clock = SimulatedTime(self)
        self.library = self.process("sdk")
        localization: Any = self.process("localization")
        localization.config = LocalizationConfig(localization=TAGS)
        with self.time():
            LocalizationService(localization)
        self.processes["localization"] = localization
        if folder is not None:
            patrol: Any = self.process("patrol")
            patrol.config = PatrolConfig(patrol=Patrol(folder=str(folder)))
            with self.time():
                PatrolService(patrol)
            self.processes["patrol"] = patrol
        self.answers: list[bool] = []  # to resets

    def suspend(self, duration_ms: int) -> None:
        """Suspend the library's program, when a thread of it calls this."""
        self.library.stall(duration_ms)
        self.run(duration_ms)  # no other thread has its turn

    def start(self, target: Callable[[], object]) -> SimulatedThread:
        """Start a thread."""
        thread = SimulatedThread(self.clock, target)
        thread.start()
        return thread

    def answer(self, key: str, payload: bytes) -> Caller:
        """Call a service; return its answer."""
        call = CALLS[key]
        request = msgspec.msgpack.decode(payload, type=call.request)
        if isinstance(request, m.ResetRequest):
            caller = self.call_reset(request)
            self.answers.append(bool(caller.done))
            return caller
        with self.time():
            caller = self.processes[call.server].call(call, request)
        self.clock.wait_for(lambda: caller.done is not None, CALL_S)
        return caller


class SimulatedSession:
    """The calls of a Zenoh session that the library makes."""

    info = SimpleNamespace(routers_zid=list)

    def __init__(self, stack: SimulatedStack) -> None:
        self._stack = stack
        self._process = stack.library

    def declare_subscriber(self, key: str, handler: Callable[[Any], None]) -> object:
        def take(envelope: Envelope) -> None:
            handler(raw(ENCODE(envelope.message)))

        self._stack.net.subscribe(Subscription(self._process, key, take, depth=1))
        return object()

    def declare_publisher(self, key: str, **_: object) -> object:
        (topic,) = (
            it
            for it in (keys.DRIVE, keys.LIMIT, keys.FIX)
            if matches(it.on(ROBOT, source="*"), key)
        )

        def put(payload: bytes) -> None:
            self._process.post(key, msgspec.msgpack.decode(payload, type=topic.message))

        matching = SimpleNamespace(matching=True)
        return SimpleNamespace(put=put, matching_status=matching, undeclare=lambda: None)

    def put(self, key: str, _: bytes, **__: object) -> None:
        """Send the emergency stop."""
        self._process.post(key, m.Message())

    def get(self, key: str, payload: bytes = b"", **_: object) -> list[SimpleNamespace]:
        """Call a service, or ask safety for its settings."""
        if key not in CALLS:
            sources = self._stack.processes["safety"].config.safety.sources
            settings: dict[str, Any] = {f"safety.sources.{name}.priority": {} for name in sources}
            return [SimpleNamespace(ok=raw(msgspec.json.encode(settings)), err=None)]
        caller = self._stack.answer(key, payload)
        if not caller.done:
            return [SimpleNamespace(ok=None, err=raw(caller.text.encode()))]
        return [SimpleNamespace(ok=raw(ENCODE(caller.answer)), err=None)]

    def close(self) -> None: ...


@contextmanager
def simulated_robot(stack: SimulatedStack) -> Iterator[t2.Robot]:
    """Yield the robot of a stack; the library, the demo and the tests' waits run in its time."""
    time = stack.clock
    threads = SimpleNamespace(
        Condition=lambda: SimulatedCondition(time),
        Event=lambda: SimulatedEvent(time),
        Lock=threading.Lock,
        Thread=lambda target, **_: SimulatedThread(time, target),
        current_thread=threading.current_thread,
    )
    session: Any = SimulatedSession(stack)
    with ExitStack() as patches:
        for module in MODULES:
            patches.enter_context(patch.object(module, "time", time))
        for module in (t2.drive, t2.stream, t2.third_party):
            patches.enter_context(patch.object(module, "threading", threads))
        with t2.Robot(session, ROBOT, "simulated") as robot:
            yield robot
