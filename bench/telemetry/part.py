"""The part ``telemetry``: who is between the board and a consumer, and what safety decides on."""

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import msgspec

from bench.path import bus, processes, stack, turns
from bench.path.page import FLOOR
from bench.path.processes import loaded, module, running
from bench.path.vehicle import Ports, compiled, free_ports
from bench.reaction.page import LOADS
from bench.series import Series
from bench.telemetry.page import AGE
from common.settings import BusSettings
from verification.harness.waiting import wait_until

BLOCKS, ROUNDS = 2, 200
DECISIONS = 1_000
PATIENCE_S = 120.0  # a decision comes every 20 ms at least


def frames() -> turns.Row:
    """Run a consumer that the board talks to."""
    return turns.Row(FLOOR, lambda it: running(consumer(it, "frames", it.to)))


def t2(
    title: str,
    home: Callable[..., AbstractContextManager[BusSettings]] = stack.local,
    attached: Sequence[str] = (),
) -> turns.Row:
    """Run T2 as shipped, with a consumer, and others that take so many ms for a sample."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with home(ports.board, ports.to) as dialled:
            config = stack.plain(dialled)
            ours = consumer(ports, "t2", config)
            others = [module("bench.path.attached", config, ms) for ms in attached]
            with running(*others, ours):
                yield

    return turns.Row(title, start)


def between(other: bus.Other) -> turns.Row:
    """Run one process that passes the board's frames on, and a consumer on that bus."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with other.stand() as where:
            source = module("bench.telemetry.source", ports.to, other.name, where)
            with running(source, consumer(ports, "by", other.name, where)):
                yield

    return turns.Row(other.title, start, other.package, other.program)


def consumer(ports: Ports, *words: object) -> Sequence[str]:
    """Return how a consumer is run."""
    return module("bench.telemetry.consumer", ports.witness, *words)


ROWS = (
    frames(),
    t2("T2"),
    t2("T2, 5 consumers", attached=["0"] * 4),
    t2("T2, 20 consumers", attached=["0"] * 19),
    t2("T2, a slow one beside", attached=["50"]),
    t2("T2, mutual TLS", stack.secured),
    *map(between, bus.OTHERS),
)


def measure(blocks: int = BLOCKS, rounds: int = ROUNDS, decisions: int = DECISIONS) -> list[Series]:
    """Return the samples of all, and the ages of what safety decided on."""
    return [
        *turns.measured(ROWS, blocks, rounds, asks=False),
        *(series for load in LOADS for series in ages(load, decisions)),
    ]


def ages(load: str, decisions: int) -> list[Series]:
    """Return how old each stream was at so many decisions, in ns."""
    ports = free_ports(asks=False)
    with tempfile.TemporaryDirectory() as folder, loaded(turns.BUSY if load == "busy" else 0):
        file = Path(folder) / "ages.json"
        noting = f"bench.telemetry.aging {file} {decisions}"
        vehicle = compiled(Path(folder)).standing(ports)
        with running(vehicle), stack.local(ports.board, ports.to, safety=noting):
            wait_until(file.exists, f"{decisions} decisions", PATIENCE_S)
            noted = msgspec.json.decode(file.read_bytes(), type=dict[str, list[int]])
    return [Series(name=(stream, AGE, load), samples_ns=some) for stream, some in noted.items()]


def versions() -> str:
    """Return what is compared, with versions."""
    return processes.versions(ROWS)
