"""Processes that belong together: started, restarted when they crash, ended in order.

A process that says that a restart will not help (exit codes 78 and 69) ends them all.
"""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import BinaryIO

from common import child_process
from common.backoff import Backoff
from common.cli_args import HOPELESS
from common.log import Logger

PATIENCE_S = 5.0  # from SIGTERM to SIGKILL; a bridge may wait 1 s for the vehicle to stand
LOOK_S = 0.1
PR_SET_PDEATHSIG = 1
# Found before any fork: between fork and exec a process with other threads must not load anything.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


@dataclass(slots=True)
class Child:
    """One process and when it may be started again."""

    name: str
    command: Sequence[str]
    process: "subprocess.Popen[bytes] | None" = None
    started_s: float = 0.0
    backoff: Backoff = field(default_factory=Backoff)
    due_s: float = 0.0


class Supervisor:
    """Keeps processes running until ``stop``; those named first are ended last.

    Their output goes to ``output``, or where the supervisor's own goes.
    """

    def __init__(
        self, commands: Sequence[tuple[str, Sequence[str]]], output: BinaryIO | None = None
    ) -> None:
        self.children = [Child(name, command) for name, command in commands]
        self._output = output
        self._stopped = False
        self._log = Logger()

    def run(self) -> int:
        """Keep them running; return 0 after ``stop``, or the exit code of a hopeless one."""
        code = 0
        try:
            while not self._stopped and not code:
                code = self.look(time.monotonic())
                time.sleep(LOOK_S)
        finally:
            self.end()
        return code

    def end(self) -> None:
        """End them all, the last one first."""
        for child in reversed(self.children):
            _end(child)

    def stop(self) -> None:
        """Let ``run`` end them all; safe in a signal handler."""
        self._stopped = True

    def look(self, now_s: float) -> int:
        """Start what is due and notice what has ended; return the code of a hopeless one, or 0."""
        for child in self.children:
            if child.process is None and now_s >= child.due_s:
                child.process = _start(child.command, self._output)
                child.started_s = now_s
            code = child.process.poll() if child.process is not None else None
            if code in HOPELESS:
                self._log.error("cannot run", process=child.name, exit_code=code)
                return int(code or 0)
            if code is not None:
                self._bury(child, code, now_s)
        return 0

    def _bury(self, child: Child, code: int, now_s: float) -> None:
        wait_s = child.backoff.after(now_s - child.started_s)
        child.process, child.due_s = None, now_s + wait_s
        self._log.error("ended, starts again", process=child.name, exit_code=code, wait_s=wait_s)


def _start(command: Sequence[str], output: BinaryIO | None) -> "subprocess.Popen[bytes]":
    # A session of its own keeps ctrl-c from reaching all at once: the bridge must find its board
    # still there when it stops the vehicle. A kill of the supervisor's session or group leaves
    # the bridge and its guard: they stop the vehicle by the signal that the system sends them then.
    return subprocess.Popen(
        command,
        env=child_process.environ(),
        stdout=output,
        stderr=output,
        start_new_session=True,
        preexec_fn=partial(_die_with_parent, os.getpid()),
    )


def _die_with_parent(parent: int) -> None:
    """Have the system end the child when the supervisor is killed; other systems do without."""
    if _prctl is not None:
        _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # killed before that
            os._exit(1)


def _end(child: Child) -> None:
    if child.process is None:
        return
    with suppress(ProcessLookupError):
        child.process.terminate()
    try:
        child.process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        child.process.kill()
        child.process.wait()
