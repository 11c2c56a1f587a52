"""Measurement of the benchmark ``telemetry``: from the board to a consumer, and sample ages."""

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import msgspec

from bench.adapters import buses
from bench.path import processes, rows, stack
from bench.path.page import FLOOR, T2
from bench.path.processes import SCHED_FIFO, loaded, module, running
from bench.path.vehicle import Ports, compiled, free_ports
from bench.reaction.responders import LOADS
from bench.series import Series
from bench.telemetry.page import AGE
from common.settings import BusSettings
from verification.harness.waiting import wait_until

BLOCKS, ROUNDS = 2, 250
DECISIONS = 1_000
PATIENCE_S = 120.0  # a decision comes every 20 ms at least


def frames() -> rows.Row:
    """Run a consumer that receives the board's datagrams."""
    return rows.Row(FLOOR, lambda it: running(consumer(it, "frames", it.to)))


def t2(
    title: str,
    home: Callable[..., AbstractContextManager[BusSettings]] = stack.local,
    attached: int = 0,
) -> rows.Row:
    """Run T2 as shipped with a consumer, and some background consumers."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with home(ports.board, ports.to) as bus:
            config = stack.plain(bus)
            ours = consumer(ports, "t2", config)
            others = [module("bench.path.background_consumer", config)] * attached
            with running(*others, ours):
                yield

    return rows.Row(title, start)


def between(other: buses.OtherBus) -> rows.Row:
    """Run a process that forwards the board's frames to another bus, and a consumer."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with other.run() as where:
            frames = ports.to, other.name, where
            forwarder = other.module(f"{SCHED_FIFO} bench.telemetry.forwarder", *frames)
            witness = ports.witness, "by", other.name, where
            with running(forwarder, other.module("bench.telemetry.consumer", *witness)):
                yield

    return rows.Row(other.title, start, other.package)


def consumer(ports: Ports, *words: object) -> Sequence[str]:
    """Return the command of a consumer."""
    return module("bench.telemetry.consumer", ports.witness, *words)


ROWS = (
    frames(),
    t2(T2),
    t2("T2, 5 consumers", attached=4),
    t2("T2, 20 consumers", attached=19),
    t2("T2, mutual TLS", stack.secured),
    *map(between, buses.OTHERS),
)


def measure(blocks: int = BLOCKS, rounds: int = ROUNDS, decisions: int = DECISIONS) -> list[Series]:
    """Return the samples of all rows, and the ages of the samples at safety's decisions."""
    return [
        *rows.measured(ROWS, blocks, rounds, requests=False),
        *(series for load in LOADS for series in ages(load, decisions)),
    ]


def ages(load: str, decisions: int) -> list[Series]:
    """Return the age of each stream at safety's decisions, in ns."""
    ports = free_ports(requests=False)
    with tempfile.TemporaryDirectory() as folder, loaded(rows.BUSY if load == "busy" else 0):
        file = Path(folder) / "ages.json"
        module_words = f"bench.telemetry.sample_ages {file} {decisions}"
        vehicle = compiled(Path(folder)).standing(ports)
        with running(vehicle), stack.local(ports.board, ports.to, safety=module_words):
            wait_until(file.exists, f"{decisions} decisions", PATIENCE_S)
            noted = msgspec.json.decode(file.read_bytes(), type=dict[str, list[int]])
    return [Series(name=(stream, AGE, load), samples_ns=some) for stream, some in noted.items()]


def versions() -> str:
    """Return the compared packages with versions."""
    return processes.versions(ROWS)
