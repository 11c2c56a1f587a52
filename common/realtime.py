"""Ahead of the crowd: what stands between the board and its wheels asks Linux for SCHED_FIFO.

On a computer that is busy an ordinary process waits its turn, by milliseconds; these do not. Who is
nearer to the wheels is ahead, so that a hang of one never keeps those from stopping the vehicle
that watch it:

======= ======== ===================================================
process priority its hang is found by
======= ======== ===================================================
guard   54       systemd's watchdog
bridge  53       the guard, which brakes
safety  52       the bridge, whose lease runs out
probe   52       systemd's watchdog: the router gives no sign of life without it
router  51       the probe, which kills it
======= ======== ===================================================

The simulated board, 55, is ahead of them all: the real one is another machine, which nothing on
this one keeps waiting.

A thread that computes on for ``LONGEST_US`` without waiting for anything runs away, and Linux ends
its process. The router is spared: a thread of it that passes on all that it can does not wait. So
is the simulated board, which may be told to flood its bridge.

Where the right to go ahead is missing, and on other systems, things go on as ordinary.
"""

import os
import sys
from contextlib import suppress

BOARD, GUARD, BRIDGE, SAFETY, PROBE, ROUTER = 55, 54, 53, 52, 52, 51
# `t2 up` itself: on a busy machine a killed process ends only when it is scheduled, and only then
# its children get their signal.
SUPERVISOR = 51
LONGEST_US = 1_000_000


def ask(priority: int, *, alone: bool = False) -> None:
    """Put this thread, and those that it starts, ahead of all ordinary ones, if that is granted.

    ``alone``: what it starts begins as ordinary.
    """
    if sys.platform == "linux":
        policy = os.SCHED_FIFO | (os.SCHED_RESET_ON_FORK if alone else 0)
        with suppress(OSError):
            os.sched_setscheduler(0, policy, os.sched_param(priority))


def limit() -> None:
    """Have Linux end this process when a thread of it that is ahead runs away."""
    if sys.platform == "linux":
        import resource  # not everywhere

        _, most = resource.getrlimit(resource.RLIMIT_RTTIME)
        longest = LONGEST_US if most == resource.RLIM_INFINITY else min(most, LONGEST_US)
        resource.setrlimit(resource.RLIMIT_RTTIME, (longest, most))


def priority(pid: int = 0) -> int:
    """Return the priority among those ahead, of this thread or a process; 0 for ordinary ones."""
    return os.sched_getparam(pid).sched_priority if sys.platform == "linux" else 0
