"""Measurement of the benchmark ``growth``: cost and delay over consumers, robots, keys, bytes."""

import contextlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain
from pathlib import Path

from bench.growth.page import CONSUMERS, KEYS, ROBOTS, SIZES
from bench.load.board import SHIPPED, board, compiled
from bench.load.stack import Pids, Ports, bridge_pid, stack
from bench.load.throughput import consuming
from bench.series import Series
from common import keys
from verification.fleet.topology import simulated_robots, site
from verification.harness.child_process import ChildProcess
from verification.harness.process_stats import CpuShares

COUNTS = {
    CONSUMERS: (1, 2, 5, 10, 20, 50),
    ROBOTS: (1, 2, 5, 10, 20),
    KEYS: (10, 30, 100, 300, 1000, 3000, 10_000),
    SIZES: (16, 256, 4096, 65_536, 262_144, 1_048_576),
}
SETTLE_S, WATCHED_S = 1.0, 3.0
LEAST = 0.98  # of the messages; the last ones may arrive after the count
# Arguments of the publisher pair: keys, bytes, Hz.
PAIRS = {KEYS: "{} 64 200", SIZES: "1 {} 50"}
EVERYTHING = f"{keys.ROOT}/001/tel/**"


def measure() -> list[Series]:
    """Return all points of all curves."""
    with tempfile.TemporaryDirectory() as folder, robot(compiled(Path(folder))) as it:
        made = consumers(it, COUNTS[CONSUMERS], WATCHED_S)
        for curve in (KEYS, SIZES):
            made += pairs(it, curve, COUNTS[curve], WATCHED_S)
    return made + robots(COUNTS[ROBOTS], WATCHED_S)


@dataclass(frozen=True, slots=True)
class Robot:
    """A bridge with its router, and a board that sends at the shipped rates."""

    endpoint: str
    router: int
    guard: int

    @property
    def pids(self) -> Pids:
        """Current pids; on a busy host the guard may have restarted the bridge."""
        return {"router": self.router, "bridge": bridge_pid(self.guard)}


@contextlib.contextmanager
def robot(program: Path) -> Iterator[Robot]:
    """Run a robot."""
    ports = Ports()
    with (
        stack(ports, ("bridge",)) as pids,
        board(program, ports.board, ports.bridge, SHIPPED),
    ):
        yield Robot(ports.endpoint, pids["router"], pids["guard"])


def consumers(it: Robot, counts: Sequence[int], seconds: float) -> list[Series]:
    """Measure with more and more consumers of everything that the bridge publishes."""
    made: list[Series] = []
    with contextlib.ExitStack() as held:
        some: list[ChildProcess] = []
        for count in counts:
            some += held.enter_context(consuming(it.endpoint, EVERYTHING, count - len(some)))
            time.sleep(SETTLE_S)
            shares = watched(it.pids, some, seconds)
            results = [each.end() for each in some]
            ranges = [each for one in results for each in one["keys"].values()]
            sent = sum(last - first + 1 for _, first, last in ranges)
            arrived = sum(came for came, *_ in ranges) / max(1, sent)
            ages_ns = list(chain.from_iterable(each["ages_ns"] for each in results))
            made += point((CONSUMERS, str(count)), shares, ages_ns, arrived)
    return made


def pairs(it: Robot, curve: str, counts: Sequence[int], seconds: float) -> list[Series]:
    """Measure with a publisher pair with more and more keys, or bytes."""
    made: list[Series] = []
    for count in counts:
        words = PAIRS[curve].format(count).split()
        with ChildProcess("bench.growth.publisher_pair", it.endpoint, *words) as pair:
            time.sleep(SETTLE_S)
            shares = watched(it.pids, [pair], seconds)
            result = pair.end()
        note = f"{result['declared_s']:.1f} s to declare them" if curve == KEYS else ""
        made += point((curve, str(count)), shares, result["ages_ns"], result["arrived"], note)
    return made


def robots(counts: Sequence[int], seconds: float) -> list[Series]:
    """Measure a site router with more and more simulated robots and one consumer of all streams."""
    made: list[Series] = []
    with (
        site() as fleet,
        ChildProcess("verification.fleet.subscriber", fleet.site, "everything") as subscriber,
    ):
        for count in counts:
            with simulated_robots(fleet, count, "peer", 0.0):
                assert fleet.simulated is not None
                time.sleep(SETTLE_S)
                shares = watched({"router": fleet.site_pid}, [subscriber, fleet.simulated], seconds)
                result, sent = subscriber.end(), fleet.simulated.end()
            ages_ns = [round(age_s * 1e9) for age_s in result["ages_s"]]
            made += point((ROBOTS, str(count)), shares, ages_ns, result["hz"] / sent["hz"])
    return made


def watched(pids: Pids, parts: Sequence[ChildProcess], seconds: float) -> dict[str, int]:
    """Count for some time; return the CPU share of these processes, in ns/s."""
    for each in parts:
        each.begin()
    with CpuShares(pids) as shares:
        time.sleep(seconds)
    return shares.ns


def point(
    name: tuple[str, str],
    shares: dict[str, int],
    ages_ns: list[int],
    arrived: float,
    note: str = "",
) -> list[Series]:
    """Return a point of a curve; its note has the share that arrived when messages were lost."""
    if arrived < LEAST:
        note = f"{arrived:.0%} arrived"
    return [
        Series(name=(*name, "delay"), samples_ns=ages_ns, note=note),
        *(Series(name=(*name, process), samples_ns=[ns]) for process, ns in shares.items()),
    ]


def versions() -> str:
    """Return the measured packages with versions."""
    return ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgpack"))
