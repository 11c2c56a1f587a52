"""Times in which safety cannot receive an emergency stop: it hangs, or the computer sleeps."""

import os
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from tests.drive_source import ConstantSource, drive_until_moving, kinds_since, moves_since
from verification.faults.namespaces import clock, step_clock
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

HANGS_S = 2.0  # longer than the lease of safety's session
SLEPT_S = 60


class Operator(ConstantSource):
    """A source that also stops, and sees what is latched."""

    def declare(self, bus: Bus) -> None:
        super().declare(bus)
        self.bus = bus
        self.latched: tuple[str, ...] = ()
        bus.subscribe(keys.SAFETY, self._take)

    def _take(self, arrival: Arrival[m.SafetyState]) -> None:
        self.latched = arrival.message.latched


@contextmanager
def operated(stack: RunningStack) -> Iterator[Operator]:
    """Return an operator whose vehicle moves."""
    with running(Loop()) as loop:
        operator = Operator(loop)
        with bus_on(stack.endpoint, loop, operator.declare):
            drive_until_moving(stack, operator)
            yield operator


def test_an_emergency_stop_is_not_lost_while_safety_hangs(tmp_path: Path) -> None:
    with running_stack(tmp_path) as stack, operated(stack) as operator:
        os.kill(stack.processes["safety"].pid, signal.SIGSTOP)
        time.sleep(HANGS_S)
        count = len(stack.trace().commands)
        operator.bus.estop()
        wait_until(lambda: "brake" in kinds_since(stack, count), "the bridge's BRAKE")
        os.kill(stack.processes["safety"].pid, signal.SIGCONT)
        wait_until(lambda: "estop" in operator.latched, "the latch")
        assert not moves_since(stack, count)


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler for the clock of the test")
def test_a_computer_that_slept_does_not_drive_on(tmp_path: Path) -> None:
    env = clock(tmp_path / "robot")
    with running_stack(tmp_path, env=env) as stack, operated(stack) as operator:
        step_clock(tmp_path / "robot", SLEPT_S, SLEPT_S)
        wait_until(lambda: stack.last() != "run", "the end of the motion")
        count = len(stack.trace().commands)
        wait_until(lambda: "estop_reader" in operator.latched, "the latch")
        assert not moves_since(stack, count)
