"""Drive over a bad link, and lose it.

The robot's host has the stack, the simulated vehicle and a router with certificates. The laptop's
host, with its own network and clock, has a client that requests motion like teleop. A link in user
space (``verification.faults.remote_host``) drops, delays and queues packets, on any kernel.
"""

import contextlib
import io
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import msgspec

from bench.child_process import ChildProcess
from bench.figures import HOST, MS, ONE, Column, Figures, Limits, Unit
from bench.host import watched
from bench.processes import MissingError
from common import clock
from common.freshness import NS_PER_S
from common.loop import Loop
from services.safety.config import SafetyConfig
from sim.requests import Wire
from sim.trace import Command
from t2 import keys
from verification.faults.namespaces import enter
from verification.faults.remote_host import Address, net
from verification.faults.stack_fixture import QUICK, QUICK_MOTORS
from verification.harness.bus import bus_on, running
from verification.harness.certificates import Site
from verification.harness.dashboard import dashboard
from verification.harness.ports import free_port
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower, moves
from verification.harness.waiting import becomes_true, wait_until

CONDITIONS = {
    "good": Wire(),
    "1 % lost": Wire(drop=0.01),
    "10 % lost": Wire(drop=0.1),
    "30 % lost": Wire(drop=0.3),
    "100 to 120 ms each way": Wire(delay=0.1, jitter=0.02),
    "200 to 250 ms each way": Wire(delay=0.2, jitter=0.05),
    "1 Mbit/s": Wire(rate=1e6, delay=0.01),
    "256 kbit/s": Wire(rate=256e3, delay=0.01),
}
NARROW = "256 kbit/s"
OUTAGES_S = {
    "down for 0.2 s": 0.2, "down for 1 s": 1.0, "down for 5 s": 5.0, "another address": 0.0,
}  # fmt: skip
PLAIN, ROOM = "empty", "office"  # worlds to drive straight on, and to turn on the spot
FINE = "camera.quality=2"  # the largest pictures
TOKEN = "bench-of-a-bad-link"
ANOTHER = 3  # the last number of the laptop's address
SETTLE_S, SECONDS, ESTOP_S, PATIENCE_S = 1.0, 4.0, 5.0, 60.0
SURE_NS = NS_PER_S  # of driving without a stop
NOTICE_NS = NS_PER_S // 20  # to detect the end of a lease
SHIPPED = SafetyConfig()
FILES = ("ca", "certificate", "private_key", "members")


@dataclass(frozen=True, slots=True)
class Hosts:
    """Both hosts, what the board received, and when bumper samples arrived on board."""

    laptop: ChildProcess  # the link and the client
    frames: TraceFollower
    bumper_ns: list[int]

    def disturb(self, what: Wire | Address) -> None:
        """Set the faults of the link from now on, or the laptop's address."""
        self.laptop.send(msgspec.json.encode(what).decode())

    def commands(self, since_ns: int) -> list[Command]:
        """Return the motion commands at the board since a time."""
        return [c for c in self.frames.follow().commands if c.mono_ns >= since_ns]

    def drives(self, since_ns: int) -> list[int]:
        """Return the time at which the vehicle began to drive without a stop, when it is sure."""
        commands = self.commands(since_ns)
        stood = max((c.mono_ns for c in commands if not moves(c)), default=since_ns)
        began = [c.mono_ns for c in commands if c.mono_ns > stood][:1]
        return began if began and clock.now_ns() - began[0] > SURE_NS else []

    def ready(self) -> None:
        """Remove the faults, and wait until the vehicle drives."""
        self.disturb(Wire())
        self.laptop.send("go")
        wait_until(lambda: self.drives(clock.now_ns() - 2 * SURE_NS), "a drive", PATIENCE_S)

    def gap_ns(self, since_ns: int) -> int:
        """Return the longest time without a bumper sample on board since a time."""
        times = [since_ns, *(at for at in list(self.bumper_ns) if at > since_ns), clock.now_ns()]
        return max(b - a for a, b in pairwise(times))


@contextlib.contextmanager
def two_hosts(folder: Path, *, with_camera: bool = False) -> Iterator[Hosts]:
    """Run both hosts, with mutual TLS between them."""
    port = free_port()
    with contextlib.redirect_stdout(io.StringIO()):  # instructions of `t2 keys`
        site = Site(folder / "keys")
        robot = site.member("robot", "001", "--address", f"{net(port)}.1")
        driver = site.member("driver", "anna", "--robot", "001")
    robots, drivers = (
        [f"bus.{name}={getattr(member, name)}" for name in FILES] for member in (robot, driver)
    )
    listen = f'["unixsock-stream/{folder}/bus.sock", "tls/0.0.0.0:{port}"]'
    with (
        running_stack(
            folder, ROOM if with_camera else PLAIN, sets=[*QUICK, *robots, FINE],
            profiles=[QUICK_MOTORS], shipped=True, listen=listen, with_camera=with_camera,
        ) as stack,
        ChildProcess(
            "verification.faults.remote_host", stack.config.bus.listen[-1],
            "bench.client", "pictures" if with_camera else "drive", "001", *drivers,
        ) as laptop,
        connected(stack, laptop) as hosts,
    ):  # fmt: skip
        yield hosts


@contextlib.contextmanager
def page_hosts(folder: Path, *, with_camera: bool) -> Iterator[Hosts]:
    """Run both hosts, with the dashboard on the robot's and a page of it on the laptop's."""
    token_file = folder / "token"
    token_file.write_text(f"{TOKEN}\n")
    sets = ["dashboard.host=0.0.0.0", f"dashboard.token_file={token_file}"]
    with (
        running_stack(
            folder, ROOM, sets=[*QUICK, FINE], profiles=[QUICK_MOTORS], shipped=True,
            with_camera=with_camera,
        ) as stack,
        dashboard(stack.endpoint, folder, *sets) as server,
        ChildProcess(
            "verification.faults.remote_host", f"http/127.0.0.1:{server.port}",
            "bench.page", TOKEN, "picture" if with_camera else "sight",
        ) as laptop,
        connected(stack, laptop) as hosts,
    ):  # fmt: skip
        yield hosts


@contextlib.contextmanager
def connected(stack: RunningStack, laptop: ChildProcess) -> Iterator[Hosts]:
    """Count the bumper samples on board while the context lasts."""
    bumper_ns: list[int] = []
    with (
        running(Loop()) as loop,
        bus_on(
            stack.endpoint, loop,
            lambda bus: bus.subscribe(keys.BUMPER, lambda it: bumper_ns.append(it.received_ns)),
        ),
    ):  # fmt: skip
        yield Hosts(laptop, TraceFollower(stack.trace_file), bumper_ns)


def measure() -> Figures:
    """Measure in a process of its own, which enters the namespaces of the robot's host."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(measure_here).result()


def measure_here() -> Figures:
    """Return the figures of each condition and outage, times in ns."""
    try:
        enter()
    except OSError as error:
        raise MissingError(f"cannot simulate two hosts: {error}") from error
    with tempfile.TemporaryDirectory() as folder, two_hosts(Path(folder)) as hosts:
        made = {name: under(hosts, faults) for name, faults in CONDITIONS.items()}
        made |= {name: outage(hosts, seconds) for name, seconds in OUTAGES_S.items()}
    for name, (program, conditions) in WITH_PICTURES.items():
        with tempfile.TemporaryDirectory() as folder, program(Path(folder)) as hosts:
            for condition in conditions:
                made[f"{condition}, {name}"] = under(hosts, CONDITIONS[condition])
                made[f"{condition}, {name}"] |= hosts.laptop.end()
    made["allowed"] = {
        "stop": [round(SHIPPED.leased["teleop"].lease * NS_PER_S) + NOTICE_NS],
        "gap": [round(SHIPPED.times.bumper_age * NS_PER_S)],
    }
    return {(name, what): v for name, one in made.items() for what, v in one.items()}


def under(hosts: Hosts, faults: Wire) -> dict[str, Sequence[float]]:
    """Drive under a condition, then stop."""
    hosts.ready()
    hosts.disturb(faults)
    time.sleep(SETTLE_S)
    late_ns: list[int] = []
    with watched(late_ns):
        since_ns = clock.now_ns()
        hosts.laptop.send("begin")
        time.sleep(SECONDS)
        commands, pressed_ns = hosts.commands(since_ns), clock.now_ns()
        hosts.laptop.send("estop")

        def braked() -> list[int]:
            return [c.mono_ns - pressed_ns for c in hosts.commands(pressed_ns) if c.kind == "brake"]

        becomes_true(braked, ESTOP_S)
    driven_ns = sum(b.mono_ns - a.mono_ns for a, b in pairwise(commands) if moves(a))
    return {
        "driven": [driven_ns / (pressed_ns - since_ns)],
        "stops": [sum(moves(a) and not moves(b) for a, b in pairwise(commands))],
        "brake": braked()[:1],
        "gap": [hosts.gap_ns(since_ns)],
        HOST: late_ns,
    }


def outage(hosts: Hosts, seconds: float) -> dict[str, Sequence[float]]:
    """Cut the link for some time, or change the laptop's address; wait until it drives again."""
    hosts.ready()
    late_ns: list[int] = []
    with watched(late_ns):
        cut_ns = clock.now_ns()
        hosts.disturb(Wire(drop=1.0) if seconds else Address(ANOTHER))
        time.sleep(seconds)
        hosts.disturb(Wire())
        back_ns = clock.now_ns()
        time.sleep(SETTLE_S)
        again = wait_until(lambda: hosts.drives(cut_ns), "a drive after an outage", PATIENCE_S)
    stopped = [c.mono_ns - cut_ns for c in hosts.commands(cut_ns) if not moves(c)][:1]
    return {
        "gap": [hosts.gap_ns(cut_ns)],
        "stop": stopped,
        "again": [max(0, again[0] - back_ns)] if stopped else [],
        HOST: late_ns,
    }


Program = Callable[[Path], AbstractContextManager[Hosts]]
# What is on the laptop, and its conditions.
WITH_PICTURES: Mapping[str, tuple[Program, Sequence[str]]] = {
    "pictures, too": (partial(two_hosts, with_camera=True), [NARROW]),
    "page": (partial(page_hosts, with_camera=False), [NARROW]),
    "page by picture": (
        partial(page_hosts, with_camera=True), ["good", "1 Mbit/s", NARROW],
    ),
}  # fmt: skip
COLUMNS = (
    Column("time in motion", "driven", Unit("%", 0.01)), Column("stops", "stops", ONE),
    Column("E-STOP to BRAKE", "brake", MS, "max"), Column("STOP after", "stop", MS, "max"),
    Column("drives again after", "again", MS, "max"),
    Column("bumper's longest gap on board", "gap", MS, "max"),
    Column("pictures", "pictures", Unit("/s", 1, 1)), Column("each", "size", Unit("kB", 1e3, 1)),
    Column("their age", "age", Unit("ms", 1e-3)),
)  # fmt: skip
LIMITS: Limits = [
    ((name,), ("allowed",), column, 1.0)
    for column in (COLUMNS[3], COLUMNS[5])
    for name in OUTAGES_S
]
