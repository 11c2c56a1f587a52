"""Responders of the benchmark ``reaction``: groups of processes that answer hits."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

from bench.adapters import buses
from bench.path.processes import SCHED_FIFO, lacking, module, running
from bench.path.stack import BRIDGE, plain, services
from bench.reaction.board import BREAK, HIT, STOP, Programs
from verification.harness.bus import at
from verification.harness.ports import free_port

LOADS = ("quiet", "busy")
Start = Callable[[Programs, int, int], AbstractContextManager[None]]  # its port, the board's port


@dataclass(frozen=True, slots=True)
class Responder:
    """One row of the table."""

    name: str
    start: Start
    package: str = ""  # required, by its name in requirements-bench.lock
    loads: Sequence[str] = LOADS

    @property
    def lacks(self) -> str:
        """The missing package; empty when the row can run."""
        return lacking(self.package)


def echo(programs: Programs, port: int, _: int) -> AbstractContextManager[None]:
    """Run a C program that compares bytes."""
    return running([programs.echo, str(port), HIT, BREAK, STOP])


def loop(_: Programs, port: int, __: int) -> AbstractContextManager[None]:
    """Run one process without T2."""
    return running(module(f"{SCHED_FIFO} bench.reaction.loop", port))


def stack(bridge: str = BRIDGE, attached: int = 0, sets: Sequence[str] = ()) -> Start:
    """Run router, bridge, safety and an operator that resets latches.

    As shipped, except for the arguments; ``attached`` is the number of consumers of everything.
    """

    def start(_: Programs, port: int, board: int) -> AbstractContextManager[None]:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        ours = services(board, port, f"bus.listen={endpoint}", *sets, bridge=bridge)
        beside = [module("bench.path.background_consumer", plain(at(endpoint)))] * attached
        return running(*ours, module("bench.reaction.resetter", endpoint), *beside)

    return start


def pair(other: buses.OtherBus, prefix: str = SCHED_FIFO) -> Start:
    """Run one process at the board and one that decides, on another bus."""

    @contextlib.contextmanager
    def start(_: Programs, port: int, __: int) -> Iterator[None]:
        script = f"{prefix} bench.adapters {other.name}"
        with other.run() as where:
            decides = other.module(script, "decide", where)
            with running(decides, other.module(script, "board", port, where)):
                yield

    return start


def realtime(other: buses.OtherBus) -> Responder:
    """Return the row of another bus with SCHED_FIFO."""
    return Responder(other.title + FIFO, pair(other), other.package)


FIFO, QUIET = ", SCHED_FIFO", LOADS[:1]
FLOOR, LOOP, REFLEX = "C, compares bytes", "Python, one process" + FIFO, "T2, reflex"
JUDGED, ORDINARY = "T2, judged stop", "T2, judged stop, ordinary"
DDS, DDS_FIFO = buses.DDS.title, buses.DDS.title + FIFO
ZENOH, POOLED = buses.ZENOH.title + FIFO, buses.POOLED.title + FIFO
NO_REFLEX = "bench.reaction.no_reflex"
RESPONDERS = (
    Responder(FLOOR, echo),
    Responder(LOOP, loop),
    Responder(REFLEX, stack()),
    Responder(f"{REFLEX}, 5 consumers attached", stack(attached=5)),
    Responder(JUDGED, stack(NO_REFLEX)),
    Responder(f"{JUDGED}, 5 consumers attached", stack(NO_REFLEX, attached=5)),
    *map(realtime, (*buses.OTHERS, buses.DIRECT)),
    Responder(ORDINARY, stack(NO_REFLEX, sets=("robot.realtime=false",)), loads=QUIET),
    Responder(DDS, pair(buses.DDS, ""), buses.DDS.package, QUIET),
)
