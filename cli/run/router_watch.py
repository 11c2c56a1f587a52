"""A router's probe, as the router runs it: started again whenever it ends; see ``router_probe``."""

import os
import subprocess
import threading
import time
from collections.abc import Callable

import msgspec

from cli.run.router_probe import Setup
from common import child_process
from common.backoff import Backoff
from common.bus.session import READERS_ENV
from common.log import Logger
from common.settings import BusSettings, Log

# One thread pool for the probe: further threads only cost wake-ups.
POOL = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app))"


class Watch:
    """Keeps a probe of this very process running until ``stop``."""

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
                Logger().error("the probe cannot run", reason=error.strerror)
            if not self._stopped.is_set():
                wait_s = self._backoff.after(time.monotonic() - started_s)
                Logger().error("the probe ended, starts again", wait_s=wait_s)
                self._stopped.wait(wait_s)

    def stop(self) -> None:
        """Make ``run`` return; safe in a signal handler."""
        self._stopped.set()
        if self._probe is not None:
            self._probe.kill()

    def _follow(self, on_answer: Callable[[], None]) -> None:
        with subprocess.Popen(
            self._command, stdout=subprocess.PIPE, env=child_process.environ() | {READERS_ENV: POOL}
        ) as self._probe:
            if self._stopped.is_set():  # stopped while the probe started
                self._probe.kill()
            assert self._probe.stdout is not None
            while os.read(self._probe.stdout.fileno(), 64):
                on_answer()
