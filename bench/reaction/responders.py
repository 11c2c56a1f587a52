"""Responders of the benchmark ``reaction``: groups of processes that answer hits."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial

from bench.adapters import buses
from bench.path.processes import lacking, module, running
from bench.path.stack import BRIDGE, SAFETY, plain, services
from bench.reaction.board import BREAK, HIT, STOP, Programs
from verification.harness.bus import at
from verification.harness.ports import free_port

Start = Callable[[Programs, int, int], AbstractContextManager[None]]  # its port, the board's port


@dataclass(frozen=True, slots=True)
class Responder:
    """One row of the table."""

    name: str
    start: Start
    package: str = ""  # required, by its name in requirements-bench.lock
    program: str = ""

    @property
    def lacks(self) -> str:
        """The missing package or program; empty when the row can run."""
        return lacking(self.package, self.program)


NO_ROUTER = "bench.reaction.no_router"


def echo(programs: Programs, port: int, _: int) -> AbstractContextManager[None]:
    """Run a C program that compares bytes."""
    return running([programs.echo, str(port), HIT, BREAK, STOP])


def alone(name: str, prefix: str = "") -> Start:
    """Run one process without T2."""
    return lambda _, port, __: running(module(f"{prefix} bench.reaction.{name}", port))


def stack(
    bridge: str = BRIDGE,
    safety: str = SAFETY,
    attached: Sequence[str] = (),
    sets: Sequence[str] = (),
) -> Start:
    """Run router, bridge, safety and an operator that resets latches.

    As shipped, except for the arguments; ``attached`` has the ms per sample of each consumer.
    """

    def start(_: Programs, port: int, board: int) -> AbstractContextManager[None]:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        listen = f"bus.listen={endpoint}"
        ours = services(board, port, listen, *sets, bridge=bridge, safety=safety)
        ours = ours[1:] if safety == NO_ROUTER else ours  # safety listens instead of the router
        beside = [
            module("bench.path.background_consumer", plain(at(endpoint)), ms) for ms in attached
        ]
        return running(*ours, module("bench.reaction.resetter", endpoint), *beside)

    return start


def pair(other: buses.OtherBus, prefix: str = "") -> Responder:
    """Run one process at the board and one that decides, on another bus."""

    @contextlib.contextmanager
    def start(_: Programs, port: int, __: int) -> Iterator[None]:
        script = f"{prefix} bench.adapters {other.name}"
        with (
            other.run() as where,
            running(module(script, "decide", where), module(script, "board", port, where)),
        ):
            yield

    title = other.title + (FIFO if prefix else "")
    return Responder(title, start, other.package, other.program)


@contextlib.contextmanager
def direct() -> Iterator[str]:
    """Yield the endpoint on which the process at the board listens."""
    yield f"tcp/127.0.0.1:{free_port()}"


FIFO = ", SCHED_FIFO"
FLOOR, LOOP, REFLEX = "C, compares bytes", "Python, one process", "T2, reflex"
JUDGED, DDS, ZENOH = "T2, judged stop", buses.OTHERS[0].title, buses.ZENOH.title
NO_REFLEX = "bench.reaction.no_reflex"
SCHED_FIFO = "bench.path.sched_fifo"
ORDINARY = ("robot.realtime=false",)
FIVE, SLOW = ("0",) * 5, ("50",)
RESPONDERS = (
    Responder(FLOOR, echo),
    Responder(LOOP, alone("loop")),
    Responder(LOOP + FIFO, alone("loop", SCHED_FIFO)),
    Responder("asyncio, one process", alone("asyncio_loop")),
    Responder(REFLEX, stack()),
    Responder(f"{REFLEX}, ordinary", stack(sets=ORDINARY)),
    Responder(f"{REFLEX}, 5 consumers attached", stack(attached=FIVE)),
    Responder(f"{REFLEX}, a slow consumer", stack(attached=SLOW)),
    Responder(JUDGED, stack(NO_REFLEX)),
    Responder(f"{JUDGED}, ordinary", stack(NO_REFLEX, sets=ORDINARY)),
    Responder(f"{JUDGED}, 5 consumers attached", stack(NO_REFLEX, attached=FIVE)),
    Responder(f"{JUDGED}, a slow consumer", stack(NO_REFLEX, attached=SLOW)),
    Responder(f"{JUDGED}, no router", stack(NO_REFLEX, NO_ROUTER)),
    *map(pair, buses.OTHERS),
    pair(buses.OTHERS[0], SCHED_FIFO),
    pair(replace(buses.ZENOH, run=partial(buses.zenoh, realtime=True)), SCHED_FIFO),
    pair(buses.OtherBus("Zenoh, direct", "zenoh_direct", direct), SCHED_FIFO),
)
