"""The whole chain: real processes, real UDP, a real router; judged by what the board received."""

import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from sim.requests import Bumper
from tests.chain import Chain, Witness, chain, until_still_s
from tests.support import bus_on, running, wait_until
from tests.teleop.terminal import Terminal, terminal

pytestmark = pytest.mark.alone

# Beside the bridge's lease of 0.2 s as shipped: 0.5 s from the death of a part to the last
# command to move.
REST_S = 0.3
STARTED = '"service": "safety", "robot": "001", "event": "started"'


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Chain]:
    with chain(tmp_path) as it:
        yield it


# Teleop takes no key for held that has been down since before it could drive.
SILENCE_S = 1.0


class Hand:
    """An operator who holds W down in ``t2 drive``."""

    def __init__(self, seat: Terminal) -> None:
        self._seat = seat
        self._held = threading.Event()
        self._gone = threading.Event()
        self._thread = threading.Thread(target=self._type, daemon=True)
        self._thread.start()

    def hold(self) -> None:
        self._held.set()

    def let_go(self) -> None:
        """Let the key go, for long enough that the next press is a new one."""
        self._held.clear()
        time.sleep(SILENCE_S)

    def leave(self) -> None:
        self._gone.set()
        self._thread.join()

    def _type(self) -> None:
        while not self._gone.wait(0.05):
            self._seat.read()
            if self._held.is_set() and self._seat.process.poll() is None:
                self._seat.type("w")


@pytest.fixture
def hand(stack: Chain) -> Iterator[Hand]:
    with terminal(stack.endpoint) as seat:
        stack.processes["teleop"] = seat.process
        hand = Hand(seat)
        yield hand
        hand.leave()


def drives(stack: Chain, hand: Hand) -> None:
    """Hold the key until the vehicle moves; let go and press again when safety wants a neutral."""

    def moving() -> bool:
        return stack.last() == "run" and stack.speed() > 0.1

    for _ in range(20):
        hand.hold()
        try:
            wait_until(moving, "the vehicle moves", patience_s=3)
        except AssertionError:
            hand.let_go()
            wait_until(lambda: stack.last() != "run", "the board is told to stop")
        else:
            return
    raise AssertionError(f"never drove: {stack.log.read_text()[-3000:]}")


@pytest.mark.parametrize("victim", ["teleop", "safety", "router"])
def test_the_death_of_any_part_stops_the_vehicle(stack: Chain, hand: Hand, victim: str) -> None:
    drives(stack, hand)
    witness = Witness()
    killed_ns = stack.kill(victim)
    wait_until(lambda: stack.last() in ("stop", "break"), "STOP at the board")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    held_up_s = witness.stop()
    took_s = until_still_s(stack.trace(), killed_ns)
    assert took_s < stack.config.bridge.lease + REST_S + held_up_s, (
        f"the machine held processes up for {held_up_s:.3f} s"
    )
    assert stack.last() in ("stop", "break")


class Stick:
    """A source that asks without a pause: unlike a held key, it is never let go by mistake."""

    def __init__(self, loop: Loop) -> None:
        self.linear = 0.0
        self._loop = loop

    def declare(self, bus: Bus) -> None:
        source = DriveSource(bus, "teleop")

        def ask(_: int) -> None:
            source.ask(self.linear, 0.0)

        self._loop.post(lambda: self._loop.every(0.05, ask))


@pytest.fixture
def stick(stack: Chain) -> Iterator[Stick]:
    with running(Loop()) as loop:
        stick = Stick(loop)
        with bus_on(stack.endpoint, loop, stick.declare):
            yield stick


def push(stack: Chain, stick: Stick) -> None:
    """Push the stick until the vehicle moves; center it first when safety wants a neutral."""
    for _ in range(10):
        stick.linear = 0.0
        centered = partial(kinds_since, stack, len(stack.trace().commands))
        wait_until(lambda: "run" in centered(), "a neutral is taken")  # noqa: B023
        stick.linear = 0.5
        try:
            wait_until(lambda: stack.speed() > 0.1, "the vehicle moves", patience_s=6)
        except AssertionError:
            continue
        return
    raise AssertionError(f"never drove: {stack.log.read_text()[-3000:]}")


def kinds_since(stack: Chain, count: int) -> set[str]:
    """Return what was commanded after that many commands."""
    return {command.kind for command in stack.trace().commands[count:]}


def moves_since(stack: Chain, count: int) -> bool:
    """Tell whether the board was told to move after that many commands, of a hundred more."""
    wait_until(lambda: len(stack.trace().commands) > count + 100, "a hundred commands")
    return any(c.kind == "run" and (c.linear or c.angular) for c in stack.trace().commands[count:])


def test_a_board_that_comes_back_is_not_driven_by_what_is_still_asked(
    stack: Chain, stick: Stick
) -> None:
    push(stack, stick)
    stack.kill("sim")
    wait_until(lambda: "link_lost" in stack.log.read_text(), "the bridge misses the board")
    stack.trace_file.unlink()
    stack.start("sim")
    wait_until(stack.trace_file.exists, "a new trace")
    assert not moves_since(stack, 0)
    push(stack, stick)


def test_a_safety_that_comes_back_is_not_driven_by_what_is_still_asked(
    stack: Chain, stick: Stick
) -> None:
    push(stack, stick)
    stack.kill("safety")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    count = len(stack.trace().commands)
    stack.start("safety")
    wait_until(lambda: stack.log.read_text().count(STARTED) == 2, "the next safety")
    assert not moves_since(stack, count)
    assert not moves_since(stack, len(stack.trace().commands))
    push(stack, stick)


def test_a_hit_is_latched_until_a_reset_whatever_is_asked(stack: Chain, stick: Stick) -> None:
    push(stack, stick)
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: stack.last() == "break", "BREAK at the board")
    stack.control.do(Bumper(pressed=False))
    stick.linear = 0.0
    count = len(stack.trace().commands)
    assert not moves_since(stack, count)
    stick.linear = 0.5
    count = len(stack.trace().commands)
    assert not moves_since(stack, count)
    assert "run" not in kinds_since(stack, count)
