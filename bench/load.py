"""CPU of the chain beside two bare processes, by function, and with N consumers."""

import contextlib
import random
import signal
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import msgspec

from bench.child_process import ChildProcess
from bench.figures import CPU, HOST, ONE, US, Column, Figures, Limits, Unit
from bench.host import watched
from bench.processes import (
    Command,
    Share,
    cpu_shares,
    module,
    on_one_cpu,
    one_pool,
    running,
)
from bench.reaction import SEED
from bench.timed import TIMED, Timing
from services.safety.config import DECISION_PERIOD_S
from t2 import keys
from verification.harness.bus import router_process, set_options
from verification.harness.ports import free_port, udp_ports
from verification.harness.process_stats import children
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower, moves
from verification.harness.waiting import wait_until

Pids = Mapping[str, int]
TURNS, TURN_S = 3, 5.0
CONSUMERS, SETTLE_S, WATCHED_S, AT_ONCE = (1, 5, 20, 50), 1.0, 3.0, 8
DECISIONS, ALLOWED_NS = 10_000, 100_000
CONSUME = "bench.zenoh_programs", "consume"
EVERYTHING = f"{keys.ROOT}/001/tel/**"
STEADY_S, PATIENCE_S = 1.0, 60.0
DECISION, ALLOWED = ("safety", "Policy.decide"), ("allowed", "Policy.decide")
T2, PAIR, TOGETHER = "T2", "two processes, Zenoh, a router", "together"
PINNED = "the same, on one CPU"
# Growth of the cost beyond the number that still counts as proportional: CPU time has a resolution
# of 10 ms, and other processes use the host.
MARGIN = 1.25


def pids_of(it: RunningStack) -> Pids:
    """Return the processes of the chain; on a busy host the guard may restart the bridge."""
    found = {name: it.processes[name].pid for name in ("router", "safety", "odom")}
    guard = it.processes["bridge"].pid
    return found | {"guard": guard, "bridge": wait_until(lambda: children(guard), "a bridge")[0]}


@contextlib.contextmanager
def chain_of_t2(folder: Path) -> Iterator[Pids]:
    """Run the chain as shipped, with a source that requests motion like teleop."""
    with (
        running_stack(folder, shipped=True) as it,
        ChildProcess("bench.client", it.endpoint, "drive", "001"),
    ):
        wait_until_it_drives(it.trace_file)
        yield pids_of(it)


@contextlib.contextmanager
def bare_pair(folder: Path, wrapped: Callable[[Command], Command] = one_pool) -> Iterator[Pids]:
    """Run the two processes with a router and the same simulated vehicle."""
    endpoint, (board, port, standby) = f"tcp/127.0.0.1:{free_port()}", udp_ports(3)
    sets = set_options(f"board.port={board}", f"board.listen_ports=[{port}, {standby}]")
    sim = module("sim", "--world", "empty", "--trace", folder / "trace.jsonl", *sets)
    pair = [
        wrapped(module("bench.zenoh_programs", "drive-board", port, endpoint, board)),
        wrapped(module("bench.zenoh_programs", "drive-decide", endpoint)),
    ]
    with router_process(endpoint) as router, running(sim, *pair) as (_, at_board, decides):
        wait_until_it_drives(folder / "trace.jsonl")
        yield {"router": router.pid, "at the board": at_board.pid, "decides": decides.pid}


CHAINS: Mapping[str, Callable[[Path], AbstractContextManager[Pids]]] = {
    T2: chain_of_t2,
    PAIR: bare_pair,
    PINNED: partial(bare_pair, wrapped=lambda command: on_one_cpu(one_pool(command))),
}


def wait_until_it_drives(trace: Path) -> None:
    """Wait until the board receives a motion, and until that is steady."""
    frames = TraceFollower(trace)
    wait_until(lambda: any(map(moves, frames.follow().commands)), "a motion", PATIENCE_S)
    time.sleep(STEADY_S)


def cpu(turns: int = TURNS, seconds: float = TURN_S) -> Figures:
    """Return the CPU of each process, in ns/s; the candidates take turns in random order."""
    samples, shuffler = defaultdict[tuple[str, ...], list[float]](list), random.Random(SEED)
    for _ in range(turns):
        for name, run in shuffler.sample([*CHAINS.items()], len(CHAINS)):
            late_ns: list[int] = []
            with (
                tempfile.TemporaryDirectory() as folder,
                run(Path(folder)) as pids,
                watched(late_ns),
            ):
                shares = cpu_shares(pids, seconds)
            together = Share(*map(sum, zip(*shares.values(), strict=True)))
            for process, share in {**shares, TOGETHER: together}.items():
                samples[name, process, "cpu"].append(share.total)
                samples[name, process, "main"].append(share.main)
                samples[name, process, HOST] += late_ns
    return samples


def stop(process: "subprocess.Popen[bytes]") -> None:
    """Stop a process in order."""
    process.send_signal(signal.SIGTERM)
    process.wait(PATIENCE_S)


@contextlib.contextmanager
def timed_chain(folder: Path) -> Iterator[dict[str, Timing]]:
    """Run the chain with timed functions, turning between walls; yield what the end fills."""
    found: dict[str, Timing] = {}
    with running_stack(folder, "office", shipped=True) as it:
        for name in TIMED:
            stop(it.processes[name])
            place = it.commands[name].index(f"services.{name}")
            it.commands[name][place : place + 1] = ["bench.timed", name, str(folder / name)]
            it.start(name)
        with ChildProcess("bench.client", it.endpoint, "drive", "001") as driver:
            driver.send("turn")
            wait_until(lambda: abs(it.control.truth().angular) > 0.0, "a motion", PATIENCE_S)
            yield found
        for name in TIMED:
            stop(it.processes[name])
            found[name] = msgspec.json.decode((folder / name).read_bytes(), type=Timing)


def functions(seconds: float = DECISIONS * DECISION_PERIOD_S) -> Figures:
    """Return the durations of functions in ns, their calls, and their share of a core in ns/s."""
    late_ns: list[int] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        timed_chain(Path(folder)) as found,
        watched(late_ns),
    ):
        time.sleep(STEADY_S + seconds)
    made: dict[tuple[str, ...], Sequence[float]] = {}
    for service, timing in found.items():
        for name, all_ns in timing.functions.items():
            made[service, name, "time"] = all_ns
            made[service, name, "calls"] = [len(all_ns) / timing.span_s]
            made[service, name, "cpu"] = [sum(all_ns) / timing.span_s]
            made[service, name, HOST] = late_ns
    return {**made, (*ALLOWED, "time"): [ALLOWED_NS]}


def consumers(counts: Sequence[int] = CONSUMERS, seconds: float = WATCHED_S) -> Figures:
    """Return CPU, delay and loss with more and more consumers of everything on board."""
    made: dict[tuple[str, ...], Sequence[float]] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        running_stack(Path(folder), shipped=True) as it,
        ThreadPoolExecutor(AT_ONCE) as pool,
        ExitStack() as held,
    ):
        some: list[ChildProcess] = []
        for count in counts:
            words = *CONSUME, it.endpoint, EVERYTHING
            new = pool.map(lambda _, words=words: ChildProcess(*words), range(count - len(some)))
            some += [held.enter_context(each) for each in new]
            time.sleep(SETTLE_S)
            late_ns: list[int] = []
            for each in some:
                each.send("begin")
            with watched(late_ns):
                shares = cpu_shares(pids_of(it), seconds)
            results: list[Any] = [each.end() for each in some]
            figures: dict[str, Sequence[float]] = {
                "router": [shares["router"].total], "bridge": [shares["bridge"].total],
                "delay": list(chain.from_iterable(each["ages_ns"] for each in results)),
                "lost": [max(each["lost"] for each in results)], HOST: late_ns,
            }  # fmt: skip
            made |= {(str(count), what): samples for what, samples in figures.items()}
    return made


SHARE = Column("share", "cpu", CPU)
CPU_COLUMNS = (
    SHARE, Column("of the pair's", "cpu", ONE, of=(PAIR, TOGETHER)),
    Column("main thread", "main", CPU),
)  # fmt: skip
CPU_LIMITS: Limits = [((T2, TOGETHER), (PAIR, TOGETHER), SHARE, 2.0)]
FUNCTION_COLUMNS = (
    Column("calls", "calls", Unit("/s", 1.0)), Column("p50", "time", US),
    Column("p99", "time", US, "p99"), Column("share", "cpu", Unit("CPU %", 1e7, 2)),
)  # fmt: skip
FUNCTION_LIMITS: Limits = [(DECISION, ALLOWED, FUNCTION_COLUMNS[1], 1.0)]
CONSUMER_COLUMNS = (
    Column("router", "router", CPU), Column("bridge", "bridge", CPU),
    Column("delay p50", "delay", US), Column("p99", "delay", US, "p99"),
    Column("lost", "lost", Unit("%", 0.01, 1)),
)  # fmt: skip
CONSUMER_LIMITS: Limits = [
    (("50",), ("1",), column, 50 * MARGIN) for column in CONSUMER_COLUMNS[:3]
]
