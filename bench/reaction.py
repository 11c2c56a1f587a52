"""Time from a bumper hit at the board to BRAKE: rows that react, block by block in random order."""

import random
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from importlib.util import find_spec
from itertools import product
from pathlib import Path

from bench.figures import HOST, ONE, US, Column, Figures, Limits
from bench.host import watched
from bench.processes import Command, compiled, module, one_pool, running
from bench.zenoh_programs import DIRECT
from common.wire import commands, framing, reports
from verification.harness.bus import set_options
from verification.harness.ports import free_port, udp_ports

SEED = 20_240_607
BLOCKS, HITS, WARM = 2, 250, 20
_, BUSY = LOADS = ("quiet", "busy")
BUSY_PROCESSES, SPIN = 4, [sys.executable, "-S", "-c", "while True: pass"]
PATIENCE_S = 600.0
HIT, CLEAR = (framing.pack(reports.BumperReport(on)).hex() for on in (True, False))
BREAK, STOP = (
    framing.pack(commands.MotionCommand(kind)).hex()
    for kind in (commands.MotionKind.BREAK, commands.MotionKind.STOP)
)
# Safety accepts a reset only while the vehicle stands.
STANDS = framing.pack(reports.VelocityReport(0, 0)).hex()

Start = Callable[[int, int], AbstractContextManager[object]]  # its port, the board's port
LOOP, REFLEX = "Python, one process", "T2, reflex"
JUDGED, DDS, ZENOH = "T2, judged stop", "CycloneDDS", "Zenoh, a router"
LINK = "Zenoh, a direct link"
PACKAGE, TIME = "cyclonedds", "time"


def stack(port: int, board: int, bridge: str = "services.bridge") -> AbstractContextManager[object]:
    """Run router, bridge and safety as shipped, and an operator that resets latches."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    ports = f"board.port={board}", f"board.listen_ports={[port, *udp_ports(1)]}"
    given = set_options(*ports, f"bus.listen={endpoint}")
    services = [module(name, *given) for name in (bridge, "services.safety")]
    operator = module("bench.client", endpoint, "reset")
    return running(module("cli", "router", *given), *services, operator)


def zenoh(port: int, _: int) -> AbstractContextManager[object]:
    """Run two processes on Zenoh, with the router as shipped."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    router = module("cli", "router", *set_options(f"bus.listen={endpoint}"))
    return running(router, *map(one_pool, pair("bench.zenoh_programs", port, endpoint)))


@contextmanager
def direct(port: int, _: int) -> Iterator[None]:
    """Run two processes on Zenoh without a router, linked as bridge and safety are."""
    with tempfile.TemporaryDirectory() as folder:
        where = f"{DIRECT}{folder}/link.sock"
        with running(*map(one_pool, pair("bench.zenoh_programs", port, where))):
            yield


def pair(name: str, port: int, where: object) -> list[Command]:
    """Return the commands of the process that decides and of the one at the board."""
    return [module(name, "decide", where), module(name, "board", port, where)]


REFLEX_ROWS: Mapping[str, Start] = {
    LOOP: lambda port, _: running(module("bench.loop", "board", port, "")),
    REFLEX: stack,
}
STOP_ROWS: dict[str, Start] = {
    JUDGED: partial(stack, bridge="bench.no_reflex"),
    ZENOH: zenoh,
    LINK: direct,
}
if find_spec(PACKAGE):  # in an unused domain
    STOP_ROWS[DDS] = lambda port, _: running(*pair("bench.dds_pair", port, 1 + free_port() % 200))
P50, P99 = Column("p50", TIME, US), Column("p99", TIME, US, "p99")
# At most these multiples of the other row.
LIMITS: Limits = [
    ((ours, load), (theirs, load), column, limit)
    for ours, theirs, column, limit in [
        (REFLEX, LOOP, P50, 1.3), (REFLEX, LOOP, P99, 1.5), (JUDGED, DDS, P50, 1.2),
        (JUDGED, ZENOH, P50, 1.0), (JUDGED, DDS, P99, 1.5),
    ]
    for load in LOADS
]  # fmt: skip


def columns(of: str) -> list[Column]:
    """Return the columns, with each median as a multiple of a row's beside the same load."""
    return [P50, P99, Column(f"of {of}", TIME, ONE, of=(of,))]


def measured(rows: Mapping[str, Start], blocks: int = BLOCKS, hits: int = HITS) -> Figures:
    """Return the samples of all rows, in ns."""
    turns = list(product(rows, LOADS))
    samples: dict[tuple[str, ...], list[int]] = {
        (*turn, figure): [] for turn in turns for figure in (TIME, HOST)
    }
    shuffler = random.Random(SEED)
    with tempfile.TemporaryDirectory() as folder:
        program = compiled("board", Path(folder))
        for _ in range(blocks):
            for name, load in shuffler.sample(turns, len(turns)):
                busy = BUSY_PROCESSES if load == BUSY else 0
                with running(*[SPIN] * busy), watched(samples[name, load, HOST]):
                    samples[name, load, TIME] += block(program, rows[name], hits)
    return samples


def block(program: str, start: Start, hits: int) -> list[int]:
    """Return the reaction times of a block, in ns; raise ``RuntimeError`` for a missed hit."""
    board, port = udp_ports(2)
    numbers = map(str, (board, port, hits, WARM))
    with start(port, board):
        done = subprocess.run(
            [program, *numbers, HIT, CLEAR, BREAK, STOP, STANDS],
            capture_output=True, text=True, timeout=PATIENCE_S, check=False,
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    return [int(line) for line in done.stdout.split()]


def is_granted() -> bool:
    """Return whether this host grants SCHED_FIFO."""
    script = "from common import realtime as r; r.request(r.GUARD); exit(r.priority() != r.GUARD)"
    return subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
