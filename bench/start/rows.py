"""Rows of the benchmark ``start``: each process from its start to its first useful output."""

import contextlib
import os
import queue
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

from bench.path.processes import robots_python
from bench.reaction.loop import BREAK, STOP, command
from common import clock, keys
from common.bus.bus import Bus
from common.loop import Loop
from verification.harness.bus import bus_on, router_process, running, set_options
from verification.harness.ports import accepts_connections, free_port, udp_ports
from verification.harness.process_stats import children
from verification.harness.waiting import PATIENCE_S

Name = tuple[str, str]  # process, event
Times = dict[Name, int]  # ns

FIRST_STOP, FIRST_BREAK, ON_BUS = "first STOP", "first BRAKE", "on the bus"
NOTHING: Name = ("`python -c pass`", "its end")
BARE: Name = ("Python, a script", FIRST_STOP)
BRIDGE = "T2, guard and bridge"
ROUTER: Name = ("T2, router", "it listens")
SAFETY: Name = ("T2, safety", ON_BUS)
ODOM: Name = ("T2, odometry", ON_BUS)
COMMANDS = {command(STOP): FIRST_STOP, command(BREAK): FIRST_BREAK}
POLL_S = 0.001
NO_BYTE_CODE = "PYTHONDONTWRITEBYTECODE"


@dataclass(frozen=True, slots=True)
class Site:
    """A running router, and the services that appear on its bus."""

    endpoint: str
    appeared: "queue.SimpleQueue[tuple[str, int]]" = field(default_factory=queue.SimpleQueue)

    def declare(self, bus: Bus) -> None:
        """Watch the liveliness tokens."""
        bus.watch_live(keys.live_key(bus.robot, "*", "*"), self._on_token)

    def until(self, service: str) -> int:
        """Return when the service appeared; raise ``queue.Empty`` after a timeout."""
        while True:
            name, now_ns = self.appeared.get(timeout=PATIENCE_S)
            if name == service:
                return now_ns

    def forget(self) -> None:
        """Forget earlier services."""
        while not self.appeared.empty():
            self.appeared.get()

    def _on_token(self, key: str, alive: bool) -> None:
        if alive:
            self.appeared.put((key.split("/")[-2], clock.now_ns()))


@contextlib.contextmanager
def site() -> Iterator[Site]:
    """Run a router and watch the services on its bus."""
    made = Site(f"tcp/127.0.0.1:{free_port()}")
    with (
        router_process(made.endpoint),
        running(Loop()) as loop,
        bus_on(made.endpoint, loop, made.declare),
    ):
        yield made


@contextlib.contextmanager
def started(*words: str) -> Iterator[tuple["subprocess.Popen[bytes]", int]]:
    """Start a Python; yield it and its start time; kill it and its children at the end."""
    # Byte code is written, as in every installation, whatever this process is set to.
    environ = {name: text for name, text in os.environ.items() if name != NO_BYTE_CODE}
    begin_ns = clock.now_ns()
    process = subprocess.Popen([robots_python(), *words], env=environ, stderr=subprocess.DEVNULL)
    try:
        yield process, begin_ns
    finally:
        for pid in (process.pid, *children(process.pid)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()


def nothing(_: Site) -> Times:
    """Time an empty Python program."""
    with started("-c", "pass") as (process, begin_ns):
        process.wait()
        return {NOTHING: clock.now_ns() - begin_ns}


def bare(_: Site) -> Times:
    """Time the script until its STOP."""
    with board() as sock:
        port = str(udp_ports(1)[0])
        with started("-m", "bench.start.script", port, str(sock.getsockname()[1])) as (
            __,
            begin_ns,
        ):
            return {BARE: first_commands(sock)[FIRST_STOP] - begin_ns}


def bridge(site: Site) -> Times:
    """Time guard and bridge until BRAKE, STOP and presence on the bus."""
    site.forget()
    with board() as sock:
        given = set_options(
            f"board.port={sock.getsockname()[1]}",
            f"board.listen_ports={udp_ports(2)}",
            f"bus.connect={site.endpoint}",
        )
        with started("-m", "services.bridge", *given) as (_, begin_ns):
            times = first_commands(sock) | {ON_BUS: site.until("bridge")}
    return {(BRIDGE, word): ns - begin_ns for word, ns in times.items()}


def router(_: Site) -> Times:
    """Time a router until it accepts a connection."""
    port = free_port()
    given = set_options(f"bus.listen=tcp/127.0.0.1:{port}")
    with started("-m", "cli", "router", *given) as (process, begin_ns):
        while not accepts_connections(port) and process.poll() is None:
            time.sleep(POLL_S)
        return {ROUTER: clock.now_ns() - begin_ns}


def safety(site: Site) -> Times:
    """Time the safety service."""
    return {SAFETY: service(site, "safety")}


def odom(site: Site) -> Times:
    """Time odometry."""
    return {ODOM: service(site, "odom")}


def service(site: Site, name: str) -> int:
    """Return how long a service takes until its presence on the bus, in ns."""
    site.forget()
    given = set_options(f"bus.connect={site.endpoint}")
    with started("-m", f"services.{name}", *given) as (_, begin_ns):
        return site.until(name) - begin_ns


@contextlib.contextmanager
def board() -> Iterator[socket.socket]:
    """Yield the socket of a board that only receives."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(PATIENCE_S)
        yield sock


def first_commands(sock: socket.socket) -> dict[str, int]:
    """Return when the board first received each command, until the first STOP."""
    received: dict[str, int] = {}
    while FIRST_STOP not in received:
        name = COMMANDS.get(sock.recv(2048))
        if name is not None:
            received.setdefault(name, clock.now_ns())
    return received


ROWS = (nothing, bare, bridge, router, safety, odom)
