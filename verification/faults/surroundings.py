"""Fault injectors for the environment: the driver's network, clocks, disk, memory."""

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from common import clock
from sim.requests import Wire
from verification.faults.injectors import hit, pid_of
from verification.faults.namespaces import MEMORY, step_clock
from verification.faults.stack_fixture import StackFixture
from verification.harness.waiting import becomes_true

LET_GO_S = 0.4
FULL = b"x" * 4096
MEMORY_MAX = 64 << 20


def network(faults: Wire) -> Callable[[StackFixture], int]:
    """Disturb the packets between the driver and the robot."""

    def inject(fixture: StackFixture) -> int:
        at_ns = clock.now_ns()
        fixture.disturb_network(faults)
        return at_ns

    return inject


def cut_and_let_go(seconds: float) -> Callable[[StackFixture], int]:
    """Cut the driver's network and release the stick meanwhile; then deliver what was queued."""

    def inject(fixture: StackFixture) -> int:
        at_ns = clock.now_ns()
        fixture.disturb_network(Wire(drop=1.0))
        time.sleep(LET_GO_S)  # the driver still requests motion
        fixture.request(0.0)
        time.sleep(seconds - LET_GO_S)
        fixture.disturb_network(Wire())
        return at_ns

    return inject


def restore_network(fixture: StackFixture) -> None:
    """Restore the driver's network."""
    fixture.disturb_network(Wire())
    fixture.restore()


def step_time_of_day(whose: str, seconds: int) -> Callable[[StackFixture], int]:
    """Step the time of day of the ``robot`` or of the ``driver``."""

    def inject(fixture: StackFixture) -> int:
        at_ns = clock.now_ns()
        step_clock(fixture.folder / whose, seconds)
        return at_ns

    return inject


def restore_clocks(fixture: StackFixture) -> None:
    """Reset the time of day of both."""
    for whose in ("robot", "driver"):
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


def starve(name: str) -> Callable[[StackFixture], int]:
    """Make the kernel kill a process out of memory, in its own memory cgroup."""

    def inject(fixture: StackFixture) -> int:
        pid = pid_of(fixture, name)
        group = MEMORY / f"t2-faults-{pid}"
        group.mkdir()
        (group / "memory.limit_in_bytes").write_text(str(MEMORY_MAX))
        Path(f"/proc/{pid}/oom_score_adj").write_text("1000")
        (group / "cgroup.procs").write_text(str(pid))
        at_ns = _exhaust_memory(group, pid)
        becomes_true(lambda: not (group / "cgroup.procs").read_text(), 1.0)
        group.rmdir()
        return at_ns

    return inject


def _exhaust_memory(group: Path, pid: int) -> int:
    """Take all memory of a cgroup until its process is dead; return the time of death."""
    hungry = "import os; x = []\nwhile True: x.append(os.urandom(1 << 20))"
    victim = os.pidfd_open(pid)
    with subprocess.Popen(
        [sys.executable, "-c", hungry],
        preexec_fn=lambda: (group / "cgroup.procs").write_text(str(os.getpid())),
    ) as eater:
        at_ns = clock.now_ns()
        while not select.select([victim], [], [], 0.0005)[0]:
            at_ns = clock.now_ns()  # still alive
        eater.kill()
    os.close(victim)
    return at_ns
