"""What is timed: each process from its start until it has done what it is for."""

import contextlib
import queue
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

from bench.reaction.loop import BREAK, STOP, command
from bench.start.processes import settings, started
from common import keys
from common.bus.bus import Bus
from common.loop import Loop
from verification.harness.bus import bus_on, router_process, running
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S

Name = tuple[str, str]  # who, and until what
Times = dict[Name, int]  # ns

FIRST_STOP, FIRST_BREAK, ON_BUS = "first STOP", "first BREAK", "on the bus"
NOTHING: Name = ("`python -c pass`", "its end")
BARE: Name = ("Python, a script", FIRST_STOP)
BRIDGE = "T2, guard and bridge"
ROUTER: Name = ("T2, router", "it listens")
SAFETY: Name = ("T2, safety", ON_BUS)
ODOM: Name = ("T2, odometry", ON_BUS)
WORDS = {command(STOP): FIRST_STOP, command(BREAK): FIRST_BREAK}
POLL_S = 0.001


@dataclass(frozen=True, slots=True)
class Site:
    """A router that runs, and who has come to its bus."""

    endpoint: str
    came: "queue.SimpleQueue[tuple[str, int]]" = field(default_factory=queue.SimpleQueue)

    def declare(self, bus: Bus) -> None:
        """Hear who comes."""
        bus.watch_live(keys.live_key(bus.robot, "*", "*"), self._hear)

    def until(self, service: str) -> int:
        """Return when the service came; raise ``queue.Empty`` when it does not."""
        while True:
            name, now_ns = self.came.get(timeout=PATIENCE_S)
            if name == service:
                return now_ns

    def forget(self) -> None:
        """Drop those who came before."""
        while not self.came.empty():
            self.came.get()

    def _hear(self, key: str, alive: bool) -> None:
        if alive:
            self.came.put((key.split("/")[-2], time.monotonic_ns()))


@contextlib.contextmanager
def site() -> Iterator[Site]:
    """Run a router, and hear who comes to it, while the context lasts."""
    made = Site(f"tcp/127.0.0.1:{free_port()}")
    with (
        router_process(made.endpoint),
        running(Loop()) as loop,
        bus_on(made.endpoint, loop, made.declare),
    ):
        yield made


def nothing(_: Site) -> Times:
    """Time a Python that does nothing."""
    with started("-c", "pass") as (process, begin_ns):
        process.wait()
        return {NOTHING: time.monotonic_ns() - begin_ns}


def bare(_: Site) -> Times:
    """Time the script until its STOP."""
    with board() as sock:
        port = str(free_port(socket.SOCK_DGRAM))
        with started("-m", "bench.start.bare", port, str(sock.getsockname()[1])) as (__, begin_ns):
            return {BARE: words(sock)[FIRST_STOP] - begin_ns}


def bridge(site: Site) -> Times:
    """Time guard and bridge until BREAK, STOP and presence on the bus."""
    site.forget()
    with board() as sock:
        given = settings(
            f"board.port={sock.getsockname()[1]}",
            f"board.listen_ports={[free_port(socket.SOCK_DGRAM) for _ in range(2)]}",
            f"bus.connect={site.endpoint}",
        )
        with started("-m", "services.bridge", *given) as (_, begin_ns):
            times = words(sock) | {ON_BUS: site.until("bridge")}
    return {(BRIDGE, word): ns - begin_ns for word, ns in times.items()}


def router(_: Site) -> Times:
    """Time a router until it takes a connection."""
    port = free_port()
    given = settings(f"bus.listen=tcp/127.0.0.1:{port}")
    with started("-m", "cli", "router", *given) as (process, begin_ns):
        while not listens(port) and process.poll() is None:
            time.sleep(POLL_S)
        return {ROUTER: time.monotonic_ns() - begin_ns}


def safety(site: Site) -> Times:
    """Time the safety service."""
    return {SAFETY: service(site, "safety")}


def odom(site: Site) -> Times:
    """Time odometry."""
    return {ODOM: service(site, "odom")}


def service(site: Site, name: str) -> int:
    """Return how long a service takes until its presence on the bus, in ns."""
    site.forget()
    given = settings(f"bus.connect={site.endpoint}")
    with started("-m", f"services.{name}", *given) as (_, begin_ns):
        return site.until(name) - begin_ns


def listens(port: int) -> bool:
    """Tell whether somebody listens on a port of loopback."""
    with socket.socket() as sock:
        return sock.connect_ex(("127.0.0.1", port)) == 0


@contextlib.contextmanager
def board() -> Iterator[socket.socket]:
    """Yield the socket of a board that only listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(PATIENCE_S)
        yield sock


def words(sock: socket.socket) -> dict[str, int]:
    """Return when the board heard each word first, until STOP came."""
    heard: dict[str, int] = {}
    while FIRST_STOP not in heard:
        word = WORDS.get(sock.recv(2048))
        if word is not None:
            heard.setdefault(word, time.monotonic_ns())
    return heard


ROWS = (nothing, bare, bridge, router, safety, odom)
