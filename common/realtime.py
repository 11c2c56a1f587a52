"""SCHED_FIFO priorities for the control chain.

On a busy computer an ordinary process waits milliseconds for its turn; these processes do not.
Priority rises toward the actuators, so that a hang of one process never delays the processes that
supervise it and stop the vehicle:

======= ======== ===================================================
process priority a hang is detected by
======= ======== ===================================================
guard   54       systemd's watchdog
bridge  53       the guard, which brakes
safety  52       the bridge, whose lease runs out
probe   52       systemd's watchdog: the probe reports for the router
router  51       the probe, which kills it
======= ======== ===================================================

The simulated board has 55, the highest priority: the real board is a separate machine.

A thread that computes for ``CPU_LIMIT_US`` without waiting is a runaway, and Linux kills its
process. The router is exempt: a busy forwarding thread does not wait. So is the simulated board,
which can flood its bridge for tests.

Bridge and safety run on one CPU together (``share_cpu``). The guard may run on any CPU, so it
brakes also when that one hangs.

Without the permission, and on other systems, processes run with normal priority, on any CPU.
"""

import os
import sys
from contextlib import suppress

BOARD, GUARD, BRIDGE, SAFETY, PROBE, ROUTER = 55, 54, 53, 52, 52, 51
# `t2 up`: a killed process ends only when it is scheduled; only then its children are signalled.
SUPERVISOR = 51
CPU_LIMIT_US = 1_000_000


def request(priority: int, *, alone: bool = False) -> None:
    """Request SCHED_FIFO for this thread and the threads it starts; ignored without permission.

    ``alone``: threads and processes that it starts have normal priority.
    """
    if sys.platform == "linux":
        policy = os.SCHED_FIFO | (os.SCHED_RESET_ON_FORK if alone else 0)
        with suppress(OSError):
            os.sched_setscheduler(0, policy, os.sched_param(priority))


def limit() -> None:
    """Make Linux kill this process when one of its SCHED_FIFO threads is a runaway."""
    if sys.platform == "linux":
        import resource  # not everywhere

        _, most = resource.getrlimit(resource.RLIMIT_RTTIME)
        longest = CPU_LIMIT_US if most == resource.RLIM_INFINITY else min(most, CPU_LIMIT_US)
        resource.setrlimit(resource.RLIMIT_RTTIME, (longest, most))


def share_cpu() -> None:
    """Run on one CPU, the last that this process may use; call it before threads start.

    A message that wakes up a thread on another CPU costs more than what that thread then does, and
    finds caches without its code. Ordinary processes may use any CPU: one may be busy.
    """
    if priority():
        with suppress(OSError):
            os.sched_setaffinity(0, {shared_cpu()})


def shared_cpu() -> int:
    """Return the CPU of ``share_cpu``."""
    return max(os.sched_getaffinity(0))


def give_way() -> None:
    """Let the other threads of this priority run first, such as Zenoh's, which send."""
    if priority():  # ordinary threads take turns anyway
        os.sched_yield()


def priority(pid: int = 0) -> int:
    """Return the SCHED_FIFO priority of this thread or a process; 0 for normal ones."""
    return os.sched_getparam(pid).sched_priority if sys.platform == "linux" else 0
