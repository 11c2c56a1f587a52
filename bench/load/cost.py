"""CPU and memory of the stack on board, compared with two hand-written processes.

Memory samples are bytes.
"""

import contextlib
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

from bench.load.board import SHIPPED, TENFOLD, board
from bench.load.page import BARE, BUS, CHAIN, TOGETHER
from bench.load.stack import Pids, Ports, stack
from bench.path.processes import robots_python
from bench.series import Series
from verification.harness.bus import router_process
from verification.harness.child_process import ChildProcess
from verification.harness.process_stats import CpuShares, memory, tree
from verification.harness.waiting import wait_until

TURNS = 3
WATCHED_S = 5.0  # at each rate in a turn
PATIENCE_S = 120.0
RATES = {"shipped": SHIPPED, "tenfold": TENFOLD}

Steady = Callable[[], bool]
Running = tuple[Pids, Steady]
Start = Callable[[Ports], AbstractContextManager[Running]]


def measure(program: Path, turns: int = TURNS, seconds: float = WATCHED_S) -> list[Series]:
    """Return CPU and memory of each process; the candidates take turns."""
    samples = defaultdict[tuple[str, ...], list[int]](list)
    for _ in range(turns):
        for name, start in ((CHAIN, on_board), (BARE, by_hand), (BUS, with_zenoh)):
            whole = partial(turn, program, start, seconds)
            made = wait_until(whole, f"a turn of {name} in which no process ends", PATIENCE_S)
            for what, values in made.items():
                for candidate, value in {**values, TOGETHER: sum(values.values())}.items():
                    samples[name, what, candidate].append(value)
    return [Series(name=name, samples_ns=some) for name, some in samples.items()]


def turn(program: Path, start: Start, seconds: float) -> dict[str, dict[str, int]]:
    """Return CPU by rate and memory by kind of each process; empty when a process has ended.

    On a busy host the guard may restart the bridge.
    """
    made, ports = {}, Ports()
    with start(ports) as (pids, steady):
        for rate, says in RATES.items():
            with board(program, ports.board, ports.bridge, says):
                wait_until(steady, "all processes at work", PATIENCE_S)
                with CpuShares(pids) as shares:
                    time.sleep(seconds)
            if not pids.keys() <= shares.ns.keys():
                return {}
            made[rate] = {candidate: shares.ns[candidate] for candidate in pids}
        used = {candidate: memory(pid) for candidate, pid in pids.items()}
    for kind in ("rss", "pss"):
        made[kind] = {candidate: of[kind] for candidate, of in used.items()}
    return made


@contextlib.contextmanager
def on_board(ports: Ports) -> Iterator[Running]:
    """Run the stack with a source that requests motion like teleop."""
    with (
        stack(ports) as pids,
        ChildProcess("verification.fleet.source", ports.endpoint, "001") as source,
    ):

        def drives() -> bool:
            source.begin()
            time.sleep(1.0)
            counts = source.end()
            return bool(counts["requests"]) and not counts["refused"]

        yield pids, drives


@contextlib.contextmanager
def by_hand(ports: Ports) -> Iterator[Running]:
    """Run the two hand-written processes."""
    words = "-m", "bench.load.two_processes", str(ports.bridge), str(ports.board)
    with subprocess.Popen([robots_python(), *words]) as process:

        def both() -> list[int]:
            return [pid for _, pid in tree("", process.pid)]

        try:
            wait_until(lambda: len(both()) == 2, "both of them")
            yield dict(zip(("at the board", "decides"), both(), strict=True)), settled
        finally:
            process.kill()


@contextlib.contextmanager
def with_zenoh(ports: Ports) -> Iterator[Running]:
    """Run the same two processes as clients of a router."""
    python = robots_python()
    words = {
        "at the board": ("board", str(ports.bridge), str(ports.board), ports.endpoint),
        "decides": ("decide", ports.endpoint),
    }
    with contextlib.ExitStack() as held:
        pids = {"router": held.enter_context(router_process(ports.endpoint, python)).pid}
        silent = []
        for name, given in words.items():
            command = [python, "-m", "bench.load.two_processes_zenoh", *given]
            process = held.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
            held.callback(process.kill)
            pids[name] = process.pid
            silent.append(process)

        def steady() -> bool:
            while silent:
                output = silent.pop().stdout
                assert output is not None
                assert output.readline() == b"received\n"
            return settled()

        yield pids, steady


def settled() -> bool:
    """Wait until they are at work."""
    time.sleep(1.0)
    return True
