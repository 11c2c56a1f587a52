"""The whole chain: real processes, real UDP, a real router; judged by what the board received."""

import threading
import time
from collections.abc import Iterator

import pytest

from sim.requests import Bumper
from tests.drive_source import Stick, kinds_since, moves_since, push, stack, stick
from verification.harness.stack import Chain, Witness, until_still_s
from verification.harness.support import wait_until
from verification.harness.teleop_terminal import Terminal, terminal

__all__ = ["stack", "stick"]  # fixtures

pytestmark = pytest.mark.alone

# Beside the bridge's lease of 0.2 s as shipped: 0.5 s from the death of a part to the last
# command to move.
REST_S = 0.3
STARTED = '"service": "safety", "robot": "001", "event": "started"'


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
    wait_until(lambda: stack.last() in ("stop", "brake"), "STOP at the board")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    held_up_s = witness.stop()
    took_s = until_still_s(stack.trace(), killed_ns)
    assert took_s < stack.config.bridge.lease + REST_S + held_up_s, (
        f"the machine held processes up for {held_up_s:.3f} s"
    )
    assert stack.last() in ("stop", "brake")


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
    wait_until(lambda: stack.last() == "brake", "BREAK at the board")
    stack.control.do(Bumper(pressed=False))
    stick.linear = 0.0
    count = len(stack.trace().commands)
    assert not moves_since(stack, count)
    stick.linear = 0.5
    count = len(stack.trace().commands)
    assert not moves_since(stack, count)
    assert "run" not in kinds_since(stack, count)
