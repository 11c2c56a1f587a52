"""How faults are made to what the stack stands on: the driver's network, clocks, disk, memory."""

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from sim.requests import Wire
from verification.faults.injectors import hit, pid_of
from verification.faults.namespaces import MEMORY, step_clock
from verification.faults.stack_fixture import Lane, until

LET_GO_S = 0.4
BURST_S = 1.0
FULL = b"x" * 4096
MEMORY_MAX = 64 << 20


def cable(faults: Wire) -> Callable[[Lane], int]:
    """Let this happen to the packets between the driver and the robot."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        lane.cable(faults)
        return at_ns

    return inject


def cut_and_let_go(seconds: float) -> Callable[[Lane], int]:
    """Cut the driver's network; the stick is let go meanwhile. Then comes what has waited."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        lane.cable(Wire(drop=1.0))
        time.sleep(LET_GO_S)  # asked for meanwhile: to drive on
        lane.ask(0.0)
        time.sleep(seconds - LET_GO_S)
        lane.cable(Wire())
        return at_ns

    return inject


def mend_cable(lane: Lane) -> None:
    """Let the driver's network be well again."""
    lane.cable(Wire())
    lane.mend()


def step(whose: str, seconds: int) -> Callable[[Lane], int]:
    """Step the time of day of the ``robot`` or of the ``driver``."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        step_clock(lane.folder / whose, seconds)
        return at_ns

    return inject


def set_clocks_right(lane: Lane) -> None:
    """Step all clocks back."""
    for whose in ("robot", "driver"):
        step_clock(lane.folder / whose, 0)
    lane.mend()


def fill_disk(lane: Lane) -> int:
    """Fill the disk that the log is on, and hit something: that wants to be logged."""
    with _ballast(lane).open("wb", buffering=0) as file:
        try:
            while True:
                file.write(FULL)
        except OSError:  # it is full now, but for less than a block
            pass
    return hit(0.3)(lane)


def empty_disk(lane: Lane) -> None:
    """Make room on the disk again."""
    _ballast(lane).unlink()
    lane.mend()


def _ballast(lane: Lane) -> Path:
    return lane.stack.log.with_name("ballast")


def starve(name: str) -> Callable[[Lane], int]:
    """Let the kernel kill a part for want of memory, in a group of its own."""

    def inject(lane: Lane) -> int:
        pid = pid_of(lane, name)
        group = MEMORY / f"t2-faults-{pid}"
        group.mkdir()
        (group / "memory.limit_in_bytes").write_text(str(MEMORY_MAX))
        Path(f"/proc/{pid}/oom_score_adj").write_text("1000")
        (group / "cgroup.procs").write_text(str(pid))
        at_ns = _eat_beside(group, pid)
        until(lambda: not (group / "cgroup.procs").read_text(), 1.0)
        group.rmdir()
        return at_ns

    return inject


def _eat_beside(group: Path, pid: int) -> int:
    """Take all memory of a group until a process of it is dead; return when that was."""
    hungry = "import os; x = []\nwhile True: x.append(os.urandom(1 << 20))"
    waiting = os.pidfd_open(pid)
    with subprocess.Popen(
        [sys.executable, "-c", hungry],
        preexec_fn=lambda: (group / "cgroup.procs").write_text(str(os.getpid())),
    ) as eater:
        at_ns = time.monotonic_ns()
        while not select.select([waiting], [], [], 0.0005)[0]:
            at_ns = time.monotonic_ns()  # it was alive then
        eater.kill()
    os.close(waiting)
    return at_ns
