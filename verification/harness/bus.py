"""Routers, event loops in a thread and bus sessions that last as long as their context."""

import contextlib
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator

from common import log, settings
from common.bus.bus import Bus
from common.loop import Loop
from verification.harness.waiting import PATIENCE_S, wait_until

Lines = list[tuple[settings.LogLevel, str, log.Fields]]  # of a log


def at(*endpoints: str, lease: float = 1.0) -> settings.BusSettings:
    """Return the settings of a client that connects to these endpoints."""
    return settings.BusSettings(connect=endpoints, lease=lease)


def listening(endpoint: str, *uplink: str) -> settings.BusSettings:
    """Return the settings of a router that listens here and connects to these uplinks."""
    return settings.BusSettings(listen=(endpoint,), uplink=uplink)


def set_options(*sets: str) -> list[str]:
    """Return settings as ``--set`` options."""
    return [word for each in sets for word in ("--set", each)]


@contextlib.contextmanager
def router_process(
    endpoint: str, python: str = sys.executable, probe_deadline: float = 30.0
) -> Iterator[subprocess.Popen[bytes]]:
    """Run ``t2 router`` as a process; it listens when the context begins.

    The watchdog's probe deadline is long: other tests may take the CPU for seconds.
    """
    sets = set_options(f"bus.listen={endpoint}", f"bus.probe_deadline={probe_deadline}")
    command = [python, "-m", "cli", "router", *sets]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        try:
            line = process.stderr.readline()
            assert b"started" in line, line
            yield process
        finally:
            process.kill()


@contextlib.contextmanager
def running(loop: Loop) -> Iterator[Loop]:
    """Run an event loop in a thread."""
    thread = threading.Thread(target=loop.run, daemon=True)
    thread.start()
    try:
        yield loop
    finally:
        loop.stop()
        thread.join(PATIENCE_S)
        loop.close()


@contextlib.contextmanager
def bus_on(endpoint: str, loop: Loop, declare: Callable[[Bus], None]) -> Iterator[Bus]:
    """Open a bus session of robot 001 with these declarations; see ``joined``."""
    with joined(at(endpoint), "001", loop, declare) as bus:
        yield bus


@contextlib.contextmanager
def joined(
    where: settings.BusSettings, robot: str, loop: Loop, declare: Callable[[Bus], object]
) -> Iterator[Bus]:
    """Open a bus session with these declarations; it is connected when the context begins.

    The loop must run. The loop's thread closes the session, because its timers may publish.
    """
    bus = Bus(where, robot, loop.post)
    declare(bus)
    bus.open()
    loop.post(lambda: loop.every(0.01, lambda _: bus.answer_queries()))
    try:
        wait_until(lambda: bus.connected, "a session with the router")
        yield bus
    finally:
        closed = threading.Event()
        loop.post(bus.close)
        loop.post(closed.set)
        assert closed.wait(PATIENCE_S), "the loop does not run"
