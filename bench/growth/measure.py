"""Measurement of the benchmark ``growth``: cost and delay over consumers and bytes."""

import contextlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain
from pathlib import Path

from bench.growth.page import CONSUMERS, SIZES
from bench.load.board import SHIPPED, board, compiled
from bench.load.stack import Pids, Ports, bridge_pid, stack
from bench.load.throughput import consuming
from bench.series import Series
from common import keys
from verification.harness.child_process import ChildProcess
from verification.harness.process_stats import CpuShares

COUNTS = {
    CONSUMERS: (1, 5, 20, 50),
    SIZES: (16, 4096, 65_536, 262_144, 1_048_576),
}
SETTLE_S, WATCHED_S = 1.0, 3.0
LEAST = 0.98  # of the messages; the last ones may arrive after the count
SIZES_HZ = 50
EVERYTHING = f"{keys.ROOT}/001/tel/**"


def measure() -> list[Series]:
    """Return all points of all curves."""
    with tempfile.TemporaryDirectory() as folder, robot(compiled(Path(folder))) as it:
        made = consumers(it, COUNTS[CONSUMERS], WATCHED_S)
        return made + sizes(it, COUNTS[SIZES], WATCHED_S)


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


def sizes(it: Robot, counts: Sequence[int], seconds: float) -> list[Series]:
    """Measure with a publisher pair whose messages have more and more bytes."""
    made: list[Series] = []
    for count in counts:
        words = it.endpoint, str(count), str(SIZES_HZ)
        with ChildProcess("bench.growth.publisher_pair", *words) as pair:
            time.sleep(SETTLE_S)
            shares = watched(it.pids, [pair], seconds)
            result = pair.end()
        made += point((SIZES, str(count)), shares, result["ages_ns"], result["arrived"])
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
) -> list[Series]:
    """Return a point of a curve; its note has the share that arrived when messages were lost."""
    note = f"{arrived:.0%} arrived" if arrived < LEAST else ""
    return [
        Series(name=(*name, "delay"), samples_ns=ages_ns, note=note),
        *(Series(name=(*name, process), samples_ns=[ns]) for process, ns in shares.items()),
    ]


def versions() -> str:
    """Return the measured packages with versions."""
    return ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgpack"))
