"""Who reacts: each a few processes, up while its context lasts."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial

from bench.path import bus
from bench.path.processes import lacking, module, running
from bench.path.stack import BRIDGE, SAFETY, plain, services
from bench.reaction.board import BREAK, HIT, STOP, Programs
from verification.harness.bus import at
from verification.harness.ports import free_port

Start = Callable[[Programs, int, int], AbstractContextManager[None]]  # its port, the board's


@dataclass(frozen=True, slots=True)
class Responder:
    """One row of the table."""

    name: str
    start: Start
    package: str = ""  # that it wants, by its name in requirements-bench.lock
    program: str = ""

    @property
    def lacks(self) -> str:
        """What is not installed here; empty when it can run."""
        return lacking(self.package, self.program)


DIRECT = "bench.reaction.direct"


def echo(programs: Programs, port: int, _: int) -> AbstractContextManager[None]:
    """Run a C program that compares bytes."""
    return running([programs.echo, str(port), HIT, BREAK, STOP])


def alone(name: str, ahead: str = "") -> Start:
    """Run one process that is no service."""
    return lambda _, port, __: running(module(f"{ahead} bench.reaction.{name}", port))


def stack(
    bridge: str = BRIDGE,
    safety: str = SAFETY,
    attached: Sequence[str] = (),
    sets: Sequence[str] = (),
) -> Start:
    """Run router, bridge, safety and an operator who resets, with a consumer for each attached.

    As shipped, but for what is given; a consumer takes so many ms for a sample.
    """

    def start(_: Programs, port: int, board: int) -> AbstractContextManager[None]:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        listen = f"bus.listen={endpoint}"
        ours = services(board, port, listen, *sets, bridge=bridge, safety=safety)
        ours = ours[1:] if safety == DIRECT else ours  # it takes the router's place
        beside = [module("bench.path.attached", plain(at(endpoint)), ms) for ms in attached]
        return running(*ours, module("bench.reaction.resetter", endpoint), *beside)

    return start


def pair(other: bus.Other, ahead: str = "") -> Responder:
    """Run one process at the board and one that decides, on somebody else's bus."""

    @contextlib.contextmanager
    def start(_: Programs, port: int, __: int) -> Iterator[None]:
        script = f"{ahead} bench.reaction.by_{other.name}"
        with (
            other.stand() as where,
            running(module(script, "judge", where), module(script, "board", port, where)),
        ):
            yield

    title = other.title + (FIFO if ahead else "")
    return Responder(title, start, other.package, other.program)


@contextlib.contextmanager
def direct() -> Iterator[str]:
    """Tell an endpoint that one of the two listens on."""
    yield f"tcp/127.0.0.1:{free_port()}"


FIFO = ", SCHED_FIFO"
FLOOR, LOOP, REFLEX = "C, compares bytes", "Python, one process", "T2, reflex"
JUDGED, DDS, ZENOH = "T2, judged stop", bus.OTHERS[0].title, bus.ZENOH.title
BLUNT = "bench.reaction.blunt"
AHEAD = "bench.path.ahead"
ORDINARY = ("robot.realtime=false",)
FIVE, SLOW = ("0",) * 5, ("50",)
RESPONDERS = (
    Responder(FLOOR, echo),
    Responder(LOOP, alone("loop")),
    Responder(LOOP + FIFO, alone("loop", AHEAD)),
    Responder("asyncio, one process", alone("aio")),
    Responder(REFLEX, stack()),
    Responder(f"{REFLEX}, ordinary", stack(sets=ORDINARY)),
    Responder(f"{REFLEX}, 5 consumers attached", stack(attached=FIVE)),
    Responder(f"{REFLEX}, a slow consumer", stack(attached=SLOW)),
    Responder(JUDGED, stack(BLUNT)),
    Responder(f"{JUDGED}, ordinary", stack(BLUNT, sets=ORDINARY)),
    Responder(f"{JUDGED}, 5 consumers attached", stack(BLUNT, attached=FIVE)),
    Responder(f"{JUDGED}, a slow consumer", stack(BLUNT, attached=SLOW)),
    Responder(f"{JUDGED}, no router", stack(BLUNT, DIRECT)),
    *map(pair, bus.OTHERS),
    pair(bus.OTHERS[0], AHEAD),
    pair(replace(bus.ZENOH, stand=partial(bus.zenoh, ahead=True)), AHEAD),
    pair(bus.Other("Zenoh, direct", "zenoh_direct", direct), AHEAD),
)
