"""Supervisor: starts processes, restarts them after a crash, and stops them in order.

If a process exits with a code for which a restart does not help (78 and 69), all are stopped. A
bridge or safety without notifications for ``WATCHDOG_S`` is killed and restarted, as by systemd.
"""

import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import BinaryIO

from common import child_process
from common.child_process import Backoff
from common.cli_args import NO_RESTART
from common.log import Logger

PATIENCE_S = 5.0  # from SIGTERM to SIGKILL; a bridge may wait 1 s until the vehicle stands still
LOOK_S = 0.1
WATCHDOG_S = 2.0  # as WatchdogSec of the units
WATCHED = ("bridge", "safety")
PR_SET_PDEATHSIG = 1
# Loaded before any fork: a process with threads must not load a library between fork and exec.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


@dataclass(slots=True)
class Child:
    """A process, and the time of its next start."""

    name: str
    command: Sequence[str]
    process: "subprocess.Popen[bytes] | None" = None
    started_s: float = 0.0
    backoff: Backoff = field(default_factory=Backoff)
    due_s: float = 0.0
    watchdog: socket.socket | None = None  # receives its notifications
    beat_s: float | None = None  # when it last notified; None before

    def notified(self) -> bool:
        """Return whether it has notified since the last call; few notifications wait."""
        with suppress(BlockingIOError):
            return self.watchdog is not None and bool(self.watchdog.recv(4096))
        return False


class Supervisor:
    """Keeps processes running until ``stop``; stops them in reverse order.

    Their output goes to ``output``, or to the supervisor's own output.
    """

    def __init__(
        self, commands: Mapping[str, Sequence[str]], output: BinaryIO | None = None
    ) -> None:
        self.children = [Child(name, command) for name, command in commands.items()]
        self._output = output
        self._stopped = False
        self._log = Logger()
        os.environ.pop("WATCHDOG_PID", None)  # of a unit that runs this; not of the children

    def run(self) -> int:
        """Keep them running; return 0 after ``stop``, or the exit code of a hopeless process."""
        code = 0
        try:
            while not self._stopped and not code:
                code = self.look(time.monotonic())
                time.sleep(LOOK_S)
        finally:
            self.end()
        return code

    def end(self) -> None:
        """Stop all processes, the last one first."""
        for child in reversed(self.children):
            _end(child)

    def stop(self) -> None:
        """Make ``run`` stop all processes and return; safe in a signal handler."""
        self._stopped = True

    def look(self, now_s: float) -> int:
        """Start due processes, handle ended ones; return the code of a hopeless process, or 0."""
        for child in self.children:
            if child.process is None and now_s >= child.due_s:
                child.process = _start(child, self._output)
                child.started_s, child.beat_s = now_s, None
            self._check_watchdog(child, now_s)
            code = child.process.poll() if child.process is not None else None
            if code in NO_RESTART:
                self._log.error("cannot run", process=child.name, exit_code=code)
                return int(code or 0)
            if code is not None:
                self._schedule_restart(child, code, now_s)
        return 0

    def _check_watchdog(self, child: Child, now_s: float) -> None:
        if child.notified():
            child.beat_s = now_s
        elif child.process and child.beat_s and now_s - child.beat_s > WATCHDOG_S:
            self._log.error("hangs: killed", process=child.name)
            child.process.kill()
            child.process.wait()

    def _schedule_restart(self, child: Child, code: int, now_s: float) -> None:
        wait_s = child.backoff.after(now_s - child.started_s)
        child.process, child.due_s = None, now_s + wait_s
        self._log.error("ended, starts again", process=child.name, exit_code=code, wait_s=wait_s)


def _start(child: Child, output: BinaryIO | None) -> "subprocess.Popen[bytes]":
    # In a session of its own, a child does not receive the terminal's Ctrl-C: the board must still
    # run when the bridge stops the vehicle. If the supervisor's session or group is killed, the
    # bridge and its guard survive and stop the vehicle on the parent-death signal.
    return subprocess.Popen(
        child.command,
        env=child_process.environ() | _watchdog(child),
        stdout=output,
        stderr=output,
        start_new_session=True,
        preexec_fn=partial(_die_with_parent, os.getpid()),
    )


def _watchdog(child: Child) -> dict[str, str]:
    """Return the variables by which a child notifies the supervisor; none if it is not watched."""
    if child.name not in WATCHED or sys.platform != "linux":
        return {}
    if child.watchdog is None:
        child.watchdog = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        child.watchdog.bind("")  # Linux chooses a name in its abstract namespace
    name = child.watchdog.getsockname().decode().replace("\0", "@", 1)
    return {"NOTIFY_SOCKET": name, "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6))}


def _die_with_parent(parent: int) -> None:
    """Request SIGTERM for the child when the supervisor dies (Linux only)."""
    if _prctl is not None:
        _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it died before the request
            os._exit(1)


def _end(child: Child) -> None:
    if child.watchdog is not None:
        child.watchdog.close()
    if child.process is None:
        return
    with suppress(ProcessLookupError):
        child.process.terminate()
    try:
        child.process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        child.process.kill()
        child.process.wait()
