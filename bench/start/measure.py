"""Measurement of the benchmark ``start``: each round starts every process once, in random order."""

import contextlib
import random
import time
from collections import defaultdict
from importlib.metadata import version

from bench.path.processes import packages
from bench.series import Series
from bench.start.page import MEMORY
from bench.start.rows import ODOM, ROUTER, ROWS, SAFETY, site, started
from common.wire.commands import MotionKind
from verification.harness.bus import set_options
from verification.harness.fake_board import board
from verification.harness.ports import free_port
from verification.harness.process_stats import children, memory
from verification.harness.waiting import wait_until

SEED = 20_240_607
ROUNDS = 100
WARM_UP = 2  # until the files are in the page cache
SETTLED_S = 5.0  # each service has published its health by then
GUARD, BRIDGE = "T2, guard", "T2, bridge"


def measure(rounds: int = ROUNDS) -> list[Series]:
    """Return the times of all starts, and the memory of the processes."""
    samples: dict[tuple[str, ...], list[int]] = defaultdict(list)
    shuffler, rows = random.Random(SEED), list(ROWS)
    with site() as here:
        for number in range(WARM_UP + rounds):
            shuffler.shuffle(rows)
            for row in rows:
                for name, ns in row(here).items():
                    samples[name] += [ns] if number >= WARM_UP else []
    times = [Series(name=name, samples_ns=some) for name, some in sorted(samples.items())]
    sizes = [
        Series(name=(MEMORY, name), samples_ns=(), note=f"{rss} {pss}")
        for name, (rss, pss) in held().items()
    ]
    return times + sizes


def held(settled_s: float = SETTLED_S) -> dict[str, tuple[int, int]]:
    """Return RSS and PSS of each process, in bytes, while all run and the board answers."""
    with contextlib.ExitStack() as stack:
        made = stack.enter_context(board())
        given = set_options(
            f"board.port={made.address[1]}",
            f"board.listen_ports={made.ports}",
            f"bus.listen=tcp/127.0.0.1:{free_port()}",
        )
        pids = {
            name: stack.enter_context(started("-m", *module, *given))[0].pid
            for name, module in (
                (ROUTER[0], ("cli", "router")),
                (GUARD, ("services.bridge",)),
                (SAFETY[0], ("services.safety",)),
                (ODOM[0], ("services.odom",)),
            )
        }
        pids[BRIDGE] = wait_until(lambda: children(pids[GUARD]), "the bridge")[0]
        made.wait_for(MotionKind.STOP)  # the bridge runs
        time.sleep(settled_s)
        sizes = {name: memory(pid) for name, pid in pids.items()}
        return {name: (of["rss"], of["pss"]) for name, of in sizes.items()}


def versions() -> str:
    """Return the measured packages with versions."""
    names = ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "msgspec"))
    return f"{names}, {packages()}"
