"""The probe of a router: a process that kills the router when it hangs.

A working old session is no evidence for a new one: key expressions can keep Zenoh busy for minutes,
whatever the access rules, and ``t2 estop`` then gets no session. So each attempt of the probe is a
new session and one query, with a deadline (``bus.probe_deadline``). A full table of sessions is no
hang: then the session before is asked (``common.bus.session.RouterCheck``). The probe is a process
of its own with the next higher priority, because hung threads may use a whole processor.

The router starts its probe with ``RouterProbe``: ``python -m cli.run.router_probe SETUP``. The
probe writes a byte to its standard output for each answer in time, and ends with its parent.
"""

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import msgspec

from common import child_process, realtime
from common import log as logs
from common.bus.session import ONE_POOL, RUNTIME_ENV, RouterCheck, router_at
from common.child_process import Backoff
from common.settings import BusSettings, Log

MISSES = 2  # in a row: a hang; a single one may be a stall
STALL_S = 0.5  # beyond the deadline of an attempt: the host stalled the probe and the router
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # they reach the group; the parent decides


class Setup(msgspec.Struct, frozen=True):
    """The settings that a router passes to its probe."""

    parent: int
    bus: BusSettings
    log: Log


# --- in the router ------------------------------------------------------------------------------


class RouterProbe:
    """Keeps a probe of this process running until ``stop``; restarts it whenever it ends."""

    def __init__(self, bus: BusSettings, log: Log) -> None:
        setup = Setup(parent=os.getpid(), bus=bus, log=log)
        text = msgspec.json.encode(setup).decode()
        self._command = child_process.command("cli.run.router_probe", text)
        self._probe: subprocess.Popen[bytes] | None = None
        self._stopped = threading.Event()
        self._backoff = Backoff()

    def run(self, on_answer: Callable[[], None]) -> None:
        """Probe until ``stop``; call ``on_answer`` for each answer of the router."""
        while not self._stopped.is_set():
            started_s = time.monotonic()
            try:
                self._follow(on_answer)
            except OSError as error:  # no memory, no process: the router continues without a probe
                logs.Logger().error("the probe cannot run", reason=error.strerror)
            if not self._stopped.is_set():
                wait_s = self._backoff.after(time.monotonic() - started_s)
                logs.Logger().error("the probe ended, starts again", wait_s=wait_s)
                self._stopped.wait(wait_s)

    def stop(self) -> None:
        """Make ``run`` return; safe in a signal handler."""
        self._stopped.set()
        if self._probe is not None:
            self._probe.kill()

    def _follow(self, on_answer: Callable[[], None]) -> None:
        with subprocess.Popen(
            self._command,
            stdout=subprocess.PIPE,
            env=child_process.environ() | {RUNTIME_ENV: ONE_POOL.format(links=2)},
        ) as self._probe:
            if self._stopped.is_set():  # stopped while the probe started
                self._probe.kill()
            assert self._probe.stdout is not None
            while os.read(self._probe.stdout.fileno(), 64):
                on_answer()


# --- in the probe -------------------------------------------------------------------------------


def main(text: str) -> int:
    """Probe until the parent has ended, or hangs and is killed."""
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)
    if realtime.priority():  # only if the parent has one; the router must not delay it
        realtime.request(realtime.PROBE)
        realtime.limit()
    setup = msgspec.json.decode(text, type=Setup)
    written = logs.configure(setup.log, "router")
    if watch(setup.parent, router_at(setup.bus)):
        logs.Logger().error(
            "the router hangs: killed for a restart",
            unanswered=MISSES,
            seconds=setup.bus.probe_deadline,
        )
    written.flush()
    os._exit(0)  # an attempt may hang in Zenoh


def watch(parent: int, where: BusSettings) -> bool:
    """Return whether the parent was killed; False if it ended by itself."""
    attempts, check, deadline_s = Attempts(), RouterCheck(where), where.probe_deadline
    while os.getppid() == parent:
        began_s = time.monotonic()
        answered = answers_in_time(check, deadline_s)
        took_s = time.monotonic() - began_s
        if answered:
            os.write(sys.stdout.fileno(), b".")
        if attempts.hung(answered, stalled=took_s > deadline_s + STALL_S):
            os.kill(parent, signal.SIGKILL)
            return True
        time.sleep(max(0.0, deadline_s / 2 - took_s))
    return False


def answers_in_time(check: RouterCheck, deadline_s: float) -> bool:
    """Return whether the router answers within the deadline."""
    ended: queue.SimpleQueue[bool] = queue.SimpleQueue()
    threading.Thread(target=lambda: ended.put(check.answers()), daemon=True).start()
    try:
        return ended.get(timeout=deadline_s)
    except queue.Empty:
        return False


class Attempts:
    """Counts the attempts without an answer."""

    def __init__(self) -> None:
        self._missed = 0
        self._forgiven = False

    def hung(self, answered: bool, *, stalled: bool) -> bool:
        """Return whether the router hangs, after an attempt; ``stalled``: so was the probe."""
        if answered:
            self._missed, self._forgiven = 0, False
        elif stalled and not self._forgiven:  # only once: a starved probe must still act
            self._missed, self._forgiven = 0, True
        else:
            self._missed += 1
        return self._missed >= MISSES


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
