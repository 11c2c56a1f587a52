"""Measurement of the benchmark ``command``: from a request to its frame."""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

from bench.adapters import buses
from bench.path import processes, rows, stack
from bench.path.page import FLOOR, T2
from bench.path.processes import SCHED_FIFO, module, running
from bench.path.vehicle import Ports
from bench.series import Series
from common.settings import BusSettings

BLOCKS, ROUNDS = 2, 250
# A frame has the requested speed at once instead of a step of the ramp.
STEEP = (
    "safety.linear_acceleration=10.0",
    "safety.deceleration=10.0",
    'safety.unsafe_overrides=["linear_acceleration", "deceleration"]',
)


def t2(title: str, home: Callable[..., AbstractContextManager[BusSettings]]) -> rows.Row:
    """Run T2 as shipped, except for the ramp, and a source that requests as teleop does."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with home(ports.board, ports.to, *STEEP) as bus:
            source = module("bench.command.source", ports.source, "t2", *stack.client_sets(bus))
            with running(source):
                yield

    return rows.Row(title, start)


def between(title: str, other: buses.OtherBus) -> rows.Row:
    """Run a source and a process that writes frames, with another bus between them."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with other.run() as where:
            frames = ports.to, ports.board, other.name, where
            writer = other.module(f"{SCHED_FIFO} bench.command.frame_writer", *frames)
            source = other.module("bench.command.source", ports.source, "by", other.name, where)
            with running(writer, source):
                yield

    return rows.Row(title, start, other.package)


ROWS = (
    between(FLOOR, buses.UDP),
    t2(T2, stack.local),
    t2("T2, mutual TLS", stack.secured),
    *(between(other.title, other) for other in buses.OTHERS),
)


def measure(blocks: int = BLOCKS, rounds: int = ROUNDS) -> list[Series]:
    """Return the samples of all rows."""
    return rows.measured(ROWS, blocks, rounds, requests=True)


def versions() -> str:
    """Return the compared packages with versions."""
    return processes.versions(ROWS)
