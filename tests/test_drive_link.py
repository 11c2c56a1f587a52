"""The drive link of the whole stack: what comes through the router moves and stops nothing."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from msgspec.structs import replace

from common import codec, keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.bus.session import client_config
from common.loop import Loop
from common.motion import Command
from common.source import DriveSource
from sim.requests import Bumper
from verification.harness.bus import at, bus_on, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

ROGUE_MPS = 0.9
AHEAD = 1000  # so far the copied number is ahead of the real one
LOCK_OUT = 2**62
LASTS_S = 1.5


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[RunningStack]:
    with running_stack(tmp_path) as it:
        yield it


class Observer:
    """A client of the router that drives, and sees what passes."""

    def __init__(self, loop: Loop) -> None:
        self.linear = 0.0
        self.motions: list[m.Motion] = []
        self.newest: dict[str, Any] = {}
        self.answers: list[str] = []
        self._loop = loop

    def declare(self, bus: Bus) -> None:
        self.bus = bus
        source = DriveSource(bus, "teleop")
        bus.subscribe(keys.MOTION, lambda arrival: self.motions.append(arrival.message), depth=64)
        for topic in (keys.SAFETY, keys.BUMPER, keys.VELOCITY):
            bus.subscribe(topic, self._take)
        self._loop.post(lambda: self._loop.every(0.05, lambda _: source.request(self.linear, 0.0)))

    def _take(self, arrival: Arrival[Any]) -> None:
        self.newest[arrival.key.removeprefix("t2/v1/001/")] = arrival.message

    @property
    def state(self) -> m.SafetyState | None:
        """Safety's newest state."""
        state: m.SafetyState | None = self.newest.get("tel/safety/state")
        return state

    def latched(self) -> tuple[str, ...]:
        return self.state.latched if self.state else ()

    def reset(self) -> str:
        """Ask for a reset, and return its answer."""
        count = len(self.answers)
        asked = m.ResetRequest(**_seen(self.state))
        self.bus.call(keys.RESET, asked, lambda _: self.answers.append(""), self.answers.append)
        wait_until(lambda: len(self.answers) > count, "an answer to the reset")
        return self.answers[-1]


def _seen(state: m.SafetyState | None) -> dict[str, Any]:
    """Return what an operator's reset refers to."""
    if state is None:
        return {}
    return {"echo": state.heartbeat, "causes": tuple(cause.id for cause in state.causes)}


@pytest.fixture
def observer(stack: RunningStack) -> Iterator[Observer]:
    with running(Loop()) as loop:
        observer = Observer(loop)
        with bus_on(stack.endpoint, loop, observer.declare):
            wait_until(lambda: observer.state and observer.motions, "safety's first messages")
            yield observer


@contextmanager
def rogue(stack: RunningStack) -> Iterator[Callable[[keys.Topic[Any], m.Message], None]]:
    """Join as a plain client of the router, and yield what puts a message as it is."""
    with zenoh.open(client_config(at(stack.endpoint))) as session:

        def put(topic: keys.Topic[Any], message: m.Message) -> None:
            session.put(topic.on("001"), codec.encode(message))

        yield put


def armed(observer: Observer) -> None:
    """Wait until a neutral request has been taken."""
    wait_until(lambda: observer.state and observer.state.verdict == "run", "safety lets run")


def copied(observer: Observer, seq: int) -> m.Motion:
    """Return a RUN that bears the newest motion's authority."""
    last = observer.motions[-1]
    return replace(last, command=Command.RUN, linear=ROGUE_MPS, source="teleop", seq=seq)


def attack(stack: RunningStack, observer: Observer) -> None:
    """Command motion at 50 Hz under safety's boot, always ahead of it."""
    with rogue(stack) as put:
        time.sleep(0.2)
        end_s, seq = time.monotonic() + LASTS_S, observer.motions[-1].seq + AHEAD
        while time.monotonic() < end_s:
            seq += 1
            put(keys.MOTION, copied(observer, seq))
            time.sleep(0.02)


def obeyed(stack: RunningStack) -> int:
    """Return how many frames the board got that only the rogue asked for."""
    return sum(round(abs(c.linear), 2) == ROGUE_MPS for c in stack.trace().commands)


def test_a_copied_authority_moves_nothing(stack: RunningStack, observer: Observer) -> None:
    armed(observer)
    attack(stack, observer)
    assert obeyed(stack) == 0
    observer.bus.estop()
    wait_until(lambda: "estop" in observer.latched(), "the emergency stop")
    attack(stack, observer)
    assert obeyed(stack) == 0
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: "contact" in observer.latched(), "the contact")
    attack(stack, observer)
    assert obeyed(stack) == 0
    assert stack.last() == "brake"


def test_without_a_router_it_brakes_until_a_reset(stack: RunningStack, observer: Observer) -> None:
    armed(observer)
    observer.linear = 0.3
    wait_until(lambda: stack.speed() > 0.1, "the vehicle moves")
    count = len(stack.trace().commands)
    killed_ns = stack.kill("router")
    wait_until(lambda: stack.last() == "brake", "BRAKE at the board")
    braked = next(c for c in stack.trace().commands[count:] if c.kind == "brake")
    assert (braked.mono_ns - killed_ns) / 1e9 < stack.config.bridge.lease
    observer.linear = 0.0
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    time.sleep(1.0)
    # By a BRAKE of its own, not by the lease: the lease sends STOP alone at standstill.
    assert {c.kind for c in stack.trace().commands if c.mono_ns > braked.mono_ns} == {"brake"}
    stack.start("router")
    wait_until(lambda: observer.bus.connected, "the router")
    observer.newest.clear()
    wait_until(lambda: "estop_reader" in observer.latched(), "the latch")
    assert stack.last() == "brake"
    wait_until(lambda: observer.reset() == "", "a reset that is granted")
    armed(observer)
