"""Fault injectors for what surrounds the services: networks, clocks, disk, the PC."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from common import clock
from sim.requests import Wire
from verification.faults.injectors import Injector, hit
from verification.faults.namespaces import step_clock
from verification.faults.stack_fixture import StackFixture
from verification.harness.network_hosts import ip
from verification.harness.process_stats import children

CLOCKS = ("robot", "driver")
LET_GO_S = 0.4
FULL = b"x" * 4096
NOT_ON_THE_PC = ("sim", "relay", "driver")


def network(faults: Wire) -> Injector:
    """Disturb the packets between the driver and the robot."""
    return lambda fixture: fixture.disturb_network(faults)


def cut_and_let_go(seconds: float) -> Injector:
    """Cut the driver's network and release the stick meanwhile; then deliver what was queued."""

    def inject(fixture: StackFixture) -> None:
        fixture.disturb_network(Wire(drop=1.0))
        time.sleep(LET_GO_S)  # the driver still requests motion
        fixture.request(0.0)
        time.sleep(seconds - LET_GO_S)
        fixture.disturb_network(Wire())

    return inject


def restore_network(fixture: StackFixture) -> None:
    """Restore the driver's network."""
    fixture.disturb_network(Wire())
    fixture.restore()


def step_time_of_day(whose: str, seconds: int) -> Injector:
    """Step the time of day of one of ``CLOCKS``."""
    return lambda fixture: step_clock(fixture.folder / whose, seconds)


def restore_clocks(fixture: StackFixture) -> None:
    """Reset the time of day of both."""
    for whose in CLOCKS:
        step_clock(fixture.folder / whose, 0)
    fixture.restore()


def fill_disk(fixture: StackFixture) -> int:
    """Fill the disk of the log, then press the bumper, which has to be logged."""
    with _ballast(fixture).open("wb", buffering=0) as file:
        try:
            while True:
                file.write(FULL)
        except OSError:  # full, except for less than a block
            pass
    return hit(0.3)(fixture)


def empty_disk(fixture: StackFixture) -> None:
    """Free the disk."""
    _ballast(fixture).unlink()
    fixture.restore()


def _ballast(fixture: StackFixture) -> Path:
    return fixture.running.log.with_name("ballast")


def signal_pc(*numbers: signal.Signals) -> Callable[[StackFixture], int]:
    """Send signals to all processes of the PC behind a relay."""

    def inject(fixture: StackFixture) -> int:
        processes = fixture.running.processes
        # Parents first: a guard must not see its bridge stop.
        pids = [process.pid for name, process in processes.items() if name not in NOT_ON_THE_PC]
        pids += [child for parent in pids for child in children(parent)]
        at_ns = clock.now_ns()
        for number in numbers:
            for pid in pids:
                os.kill(pid, number)
        return at_ns

    return inject


stop_pc = signal_pc(signal.SIGSTOP)  # as when its kernel hangs
kill_pc = signal_pc(signal.SIGSTOP, signal.SIGKILL)  # stopped first: none reacts to another's end


def continue_pc(fixture: StackFixture) -> None:
    """Continue all processes of the PC."""
    signal_pc(signal.SIGCONT)(fixture)
    fixture.restore()


def cut_cable(side: Literal["pc", "board"], seconds: float) -> Injector:
    """Cut one of the relay's two cables for some time."""

    def inject(_: StackFixture) -> None:
        ip("link", "set", f"cable-{side}", "down")
        time.sleep(seconds)
        ip("link", "set", f"cable-{side}", "up")

    return inject


def restart_relay(after_s: float) -> Injector:
    """Kill the relay, and start it again as a supervisor does."""

    def inject(fixture: StackFixture) -> int:
        at_ns = fixture.running.kill("relay")
        time.sleep(after_s)
        fixture.running.start("relay")
        return at_ns

    return inject
