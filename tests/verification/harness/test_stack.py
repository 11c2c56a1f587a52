"""The whole stack with real processes, UDP and router; asserts on the commands at the board."""

import threading
import time
from collections.abc import Iterator

import pytest

from sim.requests import Bumper
from tests.drive_source import (
    ConstantSource,
    drive_until_moving,
    kinds_since,
    moves_since,
    source,
    stack,
)
from verification.harness.host import StallRecorder
from verification.harness.stack import RunningStack
from verification.harness.teleop_terminal import Terminal, terminal
from verification.harness.trace import last_move_s
from verification.harness.waiting import wait_until

__all__ = ["source", "stack"]  # fixtures

pytestmark = pytest.mark.timed

# In addition to the bridge's lease, 0.2 s as shipped: 0.5 s from the death of a process to the last
# command that moves the vehicle.
REST_S = 0.3
STARTED = '"service": "safety", "robot": "001", "event": "started"'


# Teleop does not accept a key that was already held before it could drive.
SILENCE_S = 1.0


class KeyPresser:
    """Holds W in ``t2 drive``."""

    def __init__(self, drive_terminal: Terminal) -> None:
        self._terminal = drive_terminal
        self._held = threading.Event()
        self._gone = threading.Event()
        self._thread = threading.Thread(target=self._type, daemon=True)
        self._thread.start()

    def hold(self) -> None:
        self._held.set()

    def release(self) -> None:
        """Release the key long enough that the next press is a new one."""
        self._held.clear()
        time.sleep(SILENCE_S)

    def stop(self) -> None:
        self._gone.set()
        self._thread.join()

    def _type(self) -> None:
        while not self._gone.wait(0.05):
            self._terminal.read()
            if self._held.is_set() and self._terminal.process.poll() is None:
                self._terminal.type("w")


@pytest.fixture
def presser(stack: RunningStack) -> Iterator[KeyPresser]:
    with terminal(stack.endpoint) as drive_terminal:
        stack.processes["teleop"] = drive_terminal.process
        presser = KeyPresser(drive_terminal)
        yield presser
        presser.stop()


def drives(stack: RunningStack, presser: KeyPresser) -> None:
    """Hold the key until the vehicle moves; press again when safety requires neutral."""

    def moving() -> bool:
        return stack.last() == "run" and stack.speed() > 0.1

    for _ in range(20):
        presser.hold()
        try:
            wait_until(moving, "the vehicle moves", patience_s=3)
        except AssertionError:
            presser.release()
            wait_until(lambda: stack.last() != "run", "STOP or BRAKE at the board")
        else:
            return
    raise AssertionError(f"never drove: {stack.log.read_text()[-3000:]}")


@pytest.mark.parametrize(
    "victim",
    [
        "safety",
        pytest.param("teleop", marks=pytest.mark.campaign),
        pytest.param("router", marks=pytest.mark.campaign),
    ],
)
def test_the_death_of_any_part_stops_the_vehicle(
    stack: RunningStack, presser: KeyPresser, victim: str
) -> None:
    drives(stack, presser)
    stalls = StallRecorder()
    killed_ns = stack.kill(victim)
    wait_until(lambda: stack.last() in ("stop", "brake"), "STOP at the board")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    stall_s = stalls.stop()
    took_s = last_move_s(stack.trace().commands, killed_ns)
    assert took_s < stack.config.bridge.lease + REST_S + stall_s, (
        f"the host stalled for {stall_s:.3f} s"
    )
    assert stack.last() in ("stop", "brake")


@pytest.mark.campaign
def test_a_board_that_comes_back_is_not_driven_by_what_is_still_asked(
    stack: RunningStack, source: ConstantSource
) -> None:
    drive_until_moving(stack, source)
    stack.kill("sim")
    wait_until(lambda: "link_lost" in stack.log.read_text(), "the bridge misses the board")
    stack.trace_file.unlink()
    stack.start("sim")
    wait_until(stack.trace_file.exists, "a new trace")
    assert not moves_since(stack, 0)
    drive_until_moving(stack, source)


def test_a_safety_that_comes_back_is_not_driven_by_what_is_still_asked(
    stack: RunningStack, source: ConstantSource
) -> None:
    drive_until_moving(stack, source)
    stack.kill("safety")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    count = len(stack.trace().commands)
    stack.start("safety")
    wait_until(lambda: stack.log.read_text().count(STARTED) == 2, "the next safety")
    assert not moves_since(stack, count)
    assert not moves_since(stack, len(stack.trace().commands))
    drive_until_moving(stack, source)


def test_a_hit_is_latched_until_a_reset_whatever_is_asked(
    stack: RunningStack, source: ConstantSource
) -> None:
    drive_until_moving(stack, source)
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: stack.last() == "brake", "BRAKE at the board")
    stack.control.do(Bumper(pressed=False))
    source.linear = 0.0
    count = len(stack.trace().commands)
    assert not moves_since(stack, count)
    source.linear = 0.5
    count = len(stack.trace().commands)
    assert not moves_since(stack, count)
    assert "run" not in kinds_since(stack, count)
