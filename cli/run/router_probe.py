"""``python -m cli.run.router_probe BUS``: kills the router that started it when that hangs.

A working old session is no evidence for a new one: key expressions can make Zenoh compute for
minutes, and ``t2 estop`` then gets no session. So the probe opens a new session each time. It is a
process of its own with the next higher priority, because hung threads may use a whole processor.

It writes a byte to its standard output for each answer in time, and ends with its parent.
"""

import os
import queue
import signal
import sys
import threading
import time

import msgspec

from cli.run.router_attempts import MISSES, Attempts
from common import log, realtime
from common.bus.answering import answers, router_at
from common.freshness import NS_PER_S
from common.settings import BusSettings, Log

LOOK_S = 0.1
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # they reach the group; the parent decides


class Setup(msgspec.Struct, frozen=True):
    """The settings that a router passes to its probe."""

    parent: int
    bus: BusSettings
    log: Log


def main(text: str) -> int:
    """Probe until the parent has ended, or hangs and is killed."""
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)
    if realtime.priority():  # only if the parent has one; the router must not delay it
        realtime.ask(realtime.PROBE)
        realtime.limit()
    setup = msgspec.json.decode(text, type=Setup)
    written = log.configure(setup.log, "router")
    if watch(setup.parent, router_at(setup.bus)):
        log.Logger().error(
            "the router hangs: killed for a restart",
            unanswered=MISSES,
            seconds=setup.bus.probe_deadline,
        )
    written.drain()
    os._exit(0)  # an attempt may hang in Zenoh


def watch(parent: int, where: BusSettings) -> bool:
    """Return whether the parent was killed; False when it ended by itself."""
    attempts = Attempts(time.monotonic_ns(), round(where.probe_deadline * NS_PER_S))
    ended: queue.SimpleQueue[tuple[int, bool]] = queue.SimpleQueue()
    while os.getppid() == parent:
        number = attempts.begin(time.monotonic_ns())
        if number is not None:
            threading.Thread(target=attempt, args=(number, where, ended), daemon=True).start()
        try:
            if attempts.end(*ended.get(timeout=LOOK_S)):
                os.write(sys.stdout.fileno(), b".")
        except queue.Empty:
            pass
        if attempts.hung(time.monotonic_ns()) and os.getppid() == parent:
            os.kill(parent, signal.SIGKILL)
            return True
    return False


def attempt(number: int, where: BusSettings, ended: "queue.SimpleQueue[tuple[int, bool]]") -> None:
    """Try once, and report the result."""
    ended.put((number, answers(where)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
