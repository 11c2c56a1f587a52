"""The part ``command``: who is between a request and its frame."""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

from bench.path import bus, processes, stack, turns
from bench.path.page import FLOOR
from bench.path.processes import module, running
from bench.path.vehicle import Ports
from bench.series import Series
from common.settings import BusSettings

BLOCKS, ROUNDS = 2, 250
# So that a frame shows at once what was asked for, and not a step of the ramp on the way there.
STEEP = (
    "safety.linear_acceleration=10.0",
    "safety.deceleration=10.0",
    'safety.unsafe_overrides=["linear_acceleration", "deceleration"]',
)


def t2(title: str, home: Callable[..., AbstractContextManager[BusSettings]]) -> turns.Row:
    """Run T2 as shipped, but for the ramp, and somebody who asks as teleop does."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with home(ports.board, ports.to, *STEEP) as dialled:
            asker = module("bench.command.asker", ports.asker, "t2", *stack.joining(dialled))
            with running(asker):
                yield

    return turns.Row(title, start)


def between(title: str, other: bus.Other) -> turns.Row:
    """Run one process that makes frames of requests, and who asks by somebody else's bus."""

    @contextlib.contextmanager
    def start(ports: Ports) -> Iterator[None]:
        with other.stand() as where:
            driver = module("bench.command.driver", ports.to, ports.board, other.name, where)
            asker = module("bench.command.asker", ports.asker, "by", other.name, where)
            with running(driver, asker):
                yield

    return turns.Row(title, start, other.package, other.program)


ROWS = (
    between(FLOOR, bus.UDP),
    t2("T2", stack.local),
    t2("T2, mutual TLS", stack.secured),
    *(between(other.title, other) for other in bus.OTHERS),
)


def measure(blocks: int = BLOCKS, rounds: int = ROUNDS) -> list[Series]:
    """Return the samples of all."""
    return turns.measured(ROWS, blocks, rounds, asks=True)


def versions() -> str:
    """Return what is compared, with versions."""
    return processes.versions(ROWS)
