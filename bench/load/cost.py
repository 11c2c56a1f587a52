"""CPU, memory and bytes of the stack on board, compared with two hand-written processes."""

import contextlib
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from bench.load.board import SHIPPED, Board, board
from bench.load.page import (
    BARE,
    BUS,
    CHAIN,
    CONSUMER,
    OBSERVED,
    POOLED,
    TO_BOARD,
    TO_BRIDGE,
    TOGETHER,
)  # fmt: skip
from bench.load.stack import Pids, Ports, stack
from bench.path.processes import one_pool, robots_python
from bench.series import Series
from verification.harness.bus import router_process
from verification.harness.child_process import ChildProcess
from verification.harness.process_stats import CpuShares, memory, tree
from verification.harness.waiting import wait_until

TURNS = 3
WATCHED_S = 6.0  # in a turn
PATIENCE_S = 120.0


@dataclass(frozen=True, slots=True)
class Running:
    """The processes of a candidate, a check that they are at work, and a consumer of all."""

    pids: Pids
    is_steady: Callable[[], bool]
    consumer: ChildProcess | None = None


Start = Callable[[Ports], AbstractContextManager[Running]]


def measure(program: Path, turns: int = TURNS, seconds: float = WATCHED_S) -> list[Series]:
    """Return a second's CPU (ns) and bytes, and the memory (bytes); the candidates take turns."""
    samples = defaultdict[tuple[str, ...], list[int]](list)
    for _ in range(turns):
        for name, start in CANDIDATES.items():
            whole = partial(turn, program, start, seconds)
            made = wait_until(whole, f"a turn of {name} in which no process ends", PATIENCE_S)
            for what, values in made.items():
                for process, value in {**values, TOGETHER: sum(values.values())}.items():
                    samples[name, what, process].append(value)
    return [Series(name=name, samples_ns=some) for name, some in samples.items()]


def turn(program: Path, start: Start, seconds: float) -> dict[str, dict[str, int]]:
    """Return CPU, memory and bytes; empty when a process has ended.

    On a busy host the guard may restart the bridge.
    """
    ports = Ports()
    with start(ports) as it, board(program, ports.board, ports.bridge, SHIPPED) as sender:
        wait_until(it.is_steady, "all processes at work", PATIENCE_S)
        before, since_s = counted(sender, None), time.monotonic()
        if it.consumer:
            it.consumer.begin()
        with CpuShares(it.pids) as shares:
            time.sleep(seconds)
        after, past_s = counted(sender, it.consumer), time.monotonic() - since_s
        if not it.pids.keys() <= shares.ns.keys():
            return {}
        used = {process: memory(pid) for process, pid in it.pids.items()}
    return {
        "cpu": {process: shares.ns[process] for process in it.pids},
        "bytes": {link: round((after[link] - before.get(link, 0)) / past_s) for link in after},
        **{kind: {process: of[kind] for process, of in used.items()} for kind in ("rss", "pss")},
    }


def counted(sender: Board, consumer: ChildProcess | None) -> Mapping[str, int]:
    """Return the bytes on each link so far."""
    received, sent = sender.counted()
    links = {TO_BOARD: received, TO_BRIDGE: sent}
    return links | {CONSUMER: consumer.end()["bytes"]} if consumer else links


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

        yield Running(pids, drives)


@contextlib.contextmanager
def observed(ports: Ports) -> Iterator[Running]:
    """Run the same with one consumer of everything."""
    with (
        on_board(ports) as it,
        ChildProcess("bench.load.byte_counter", ports.endpoint) as consumer,
    ):
        yield replace(it, consumer=consumer)


@contextlib.contextmanager
def by_hand(ports: Ports) -> Iterator[Running]:
    """Run the two hand-written processes."""
    words = "-m", "bench.load.two_processes", str(ports.bridge), str(ports.board)
    with subprocess.Popen([robots_python(), *words]) as process:

        def both() -> list[int]:
            return [pid for _, pid in tree("", process.pid)]

        try:
            wait_until(lambda: len(both()) == 2, "both of them")
            yield Running(dict(zip(("at the board", "decides"), both(), strict=True)), settled)
        finally:
            process.kill()


@contextlib.contextmanager
def with_zenoh(ports: Ports, *, pooled: bool = False) -> Iterator[Running]:
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
            plain = [python, "-m", "bench.load.two_processes_zenoh", *given]
            command = one_pool(plain) if pooled else plain
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

        yield Running(pids, steady)


def settled() -> bool:
    """Wait until they are at work."""
    time.sleep(1.0)
    return True


CANDIDATES: Mapping[str, Start] = {
    CHAIN: on_board,
    OBSERVED: observed,
    BARE: by_hand,
    BUS: with_zenoh,
    POOLED: partial(with_zenoh, pooled=True),
}
