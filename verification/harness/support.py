"""What integration tests need: a router of their own, a loop in a thread, and waiting-until."""

import contextlib
import itertools
import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from common import log, settings
from common.bus.bus import Bus
from common.loop import Loop

PATIENCE_S = 20.0
Lines = list[tuple[settings.LogLevel, str, log.Fields]]  # of a log
WORKERS = 8  # whose ports do not meet
T = TypeVar("T")


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """Return a port of 127.0.0.1 that nobody has, and that nobody else is given meanwhile."""
    while True:
        port = next(PORTS)
        with socket.socket(socket.AF_INET, kind) as sock, contextlib.suppress(OSError):
            sock.bind(("127.0.0.1", port))
            return port


def ports() -> Iterator[int]:
    """Yield the ports of this process, in turn and from anywhere on.

    They lie below those that the kernel gives out (32768); each worker of a test run has its own.
    """
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % WORKERS
    mine = range(10_000 + worker, 32_000, WORKERS)
    first = random.randrange(len(mine))
    return itertools.cycle([*mine[first:], *mine[:first]])


PORTS = ports()


def wait_until(true: Callable[[], T], what: str, patience_s: float = PATIENCE_S) -> T:
    """Return what is true once it is; fail with ``what`` when that takes too long."""
    deadline = time.monotonic() + patience_s
    while not (found := true()):
        if time.monotonic() > deadline:
            raise AssertionError(f"waited {patience_s:.0f} s for: {what}")
        time.sleep(0.005)
    return found


def at(*endpoints: str, lease: float = 1.0) -> settings.BusSettings:
    """Return the settings of who dials these."""
    return settings.BusSettings(connect=endpoints, lease=lease)


def listening(endpoint: str, *uplink: str) -> settings.BusSettings:
    """Return the settings of a router there, which dials these."""
    return settings.BusSettings(listen=(endpoint,), uplink=uplink)


@contextlib.contextmanager
def router_process(
    endpoint: str, python: str = sys.executable, probe_deadline: float = 30.0
) -> Iterator[subprocess.Popen[bytes]]:
    """Run ``t2 router`` as a process of its own, listening when the context begins.

    Its probe is patient: other tests may keep this router from the processor for seconds.
    """
    settings = [f"bus.listen={endpoint}", f"bus.probe_deadline={probe_deadline}"]
    command = [python, "-m", "cli", "router", *(w for each in settings for w in ("--set", each))]
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
    """Run a loop in a thread while the context lasts."""
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
    """Open a bus of robot 001 with these declarations, see ``joined``."""
    with joined(at(endpoint), "001", loop, declare) as bus:
        yield bus


@contextlib.contextmanager
def joined(
    where: settings.BusSettings, robot: str, loop: Loop, declare: Callable[[Bus], object]
) -> Iterator[Bus]:
    """Open a bus with these declarations, connected when the context begins.

    The loop runs. It is the loop's thread that closes the bus: its timers may be putting.
    """
    bus = Bus(where, robot, loop.post)
    declare(bus)
    bus.open()
    try:
        wait_until(lambda: bus.connected, "a session with the router")
        yield bus
    finally:
        closed = threading.Event()
        loop.post(bus.close)
        loop.post(closed.set)
        assert closed.wait(PATIENCE_S), "the loop does not run"
