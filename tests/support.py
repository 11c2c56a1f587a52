"""What integration tests need: a router of their own, a loop in a thread, and waiting-until."""

import contextlib
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

from common.bus.bus import Bus
from common.loop import Loop

PATIENCE_S = 20.0


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """Return a port of 127.0.0.1 that was free a moment ago."""
    with socket.socket(socket.AF_INET, kind) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def wait_until(true: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
    """Return once it is true; fail with ``what`` when that takes too long."""
    deadline = time.monotonic() + patience_s
    while not true():
        if time.monotonic() > deadline:
            raise AssertionError(f"waited {patience_s:.0f} s for: {what}")
        time.sleep(0.005)


@contextlib.contextmanager
def router_process(endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run ``t2 router`` as a process of its own, listening when the context begins."""
    command = [sys.executable, "-m", "cli", "router", "--set", f"bus.listen={endpoint}"]
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
    """Open a bus with these declarations, connected when the context begins."""
    bus = Bus([endpoint], "001", loop.post)
    declare(bus)
    bus.open()
    try:
        wait_until(lambda: bus.connected, "a session with the router")
        yield bus
    finally:
        bus.close()
