"""The whole stack as processes of its own, with a simulator that writes down what it received."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from cli.demo import host_stalls
from cli.demo.score import Trace, read
from cli.run.up import commands
from cli.settings import Everything
from common.config import Sources, load
from common.freshness import NS_PER_S
from sim.control import Control
from verification.harness.support import free_port, wait_until

BESIDE_OTHERS_S = 0.3  # of stalls, at least, while other tests run
UP_S = 60.0  # on a machine that others use, too


@dataclass
class Chain:
    """Running processes by name, and how to look at the board."""

    endpoint: str
    trace_file: Path
    control: Control
    commands: dict[str, list[str]]
    log: Path
    config: Everything  # in force
    env: Mapping[str, str] | None = None  # of the processes; ours when None
    processes: dict[str, "subprocess.Popen[bytes]"] = field(default_factory=dict)
    others: list["subprocess.Popen[bytes]"] = field(default_factory=list)  # beside the stack

    def start(self, name: str) -> None:
        """Start one of them, or start it again."""
        with self.log.open("ab") as output:
            self.processes[name] = subprocess.Popen(
                self.commands[name], stdout=output, stderr=output, env=self.env
            )

    def kill(self, name: str) -> int:
        """Kill one of them with -9; return when, in monotonic nanoseconds."""
        process = self.processes[name]
        at_ns = time.monotonic_ns()
        process.send_signal(signal.SIGKILL)
        process.wait()
        return at_ns

    def trace(self) -> Trace:
        """Return what the simulator has written down so far."""
        return read(self.trace_file)

    def last(self) -> str:
        """Return the kind of the command that the board holds."""
        made = self.trace().commands
        return made[-1].kind if made else "none"

    def speed(self) -> float:
        """Return how fast the vehicle really is, in m/s."""
        return self.control.truth().linear

    def end(self) -> None:
        """End them all."""
        for process in (*self.processes.values(), *self.others):
            process.kill()
            process.communicate()  # closes its pipes, too


@contextlib.contextmanager
def chain(
    folder: Path,
    world: str = "empty",
    *,
    sets: Sequence[str] = (),
    shipped: bool = False,
    listen: str = "tcp/127.0.0.1:{port}",
    log: str = "log.jsonl",
    env: Mapping[str, str] | None = None,
    route: Callable[[Sequence[str]], list[str]] | None = None,
) -> Iterator[Chain]:
    """Run the stack while the context lasts, as shipped unless this machine cannot bear it.

    ``shipped`` wants the shipped limits on any machine; ``sets`` are settings besides. ``listen``
    is where the router listens, the way of those on board first; ``log`` is a file in the folder.
    ``route`` returns the command of a router that is none of ours, for these settings.
    """
    beside_others = "PYTEST_XDIST_WORKER" in os.environ  # they stall it later, if not now
    holdup_s = 0.0 if shipped else max(host_stalls.measured(), BESIDE_OTHERS_S * beside_others)
    board, first, second, control = (free_port(socket.SOCK_DGRAM) for _ in range(4))
    port = free_port()
    sets = host_stalls.with_accepted_joined(
        [
            *sets,
            f"board.port={board}",
            f"board.listen_ports=[{first}, {second}]",
            f"bus.listen={listen.format(port=port)}",
            f"sim.control_port={control}",
            *host_stalls.settings(holdup_s),
        ]
    )
    config = load(Everything, Sources(sets=sets)).config
    files = [file for file in (folder / "lane.toml",) if file.exists()]
    options = Namespace(no_sim=False, world=world, config=files, sets=sets)
    made = {name: list(command) for name, command in commands(options)}
    if route:
        made["router"] = route(sets)
    trace_file = folder / "trace.jsonl"
    made["sim"] += ["--trace", str(trace_file)]
    endpoint = config.bus.endpoints[0]
    it = Chain(endpoint, trace_file, Control(control), made, folder / log, config, env)
    for name in made:
        it.start(name)
    try:
        wait_until(lambda: _is_up(it), f"all processes up: {it.log}", UP_S)
        yield it
    finally:
        it.end()


def _is_up(it: Chain) -> bool:
    ended = [name for name, process in it.processes.items() if process.poll() is not None]
    assert not ended, f"{ended} ended: {it.log.read_text()}"
    ours = [command for command in it.commands.values() if command[0] == sys.executable]
    return it.log.read_text().count('"event": "started"') >= len(ours)


class Witness:
    """Notes how long this machine holds a process up that only wants to sleep.

    A deadline that is met late by no more than this was met by the program and missed by the
    machine.
    """

    def __init__(self) -> None:
        # A process of its own: a thread would also wait for this interpreter's lock.
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-c", WITNESS], stdout=subprocess.PIPE, text=True
        )

    def stop(self) -> float:
        """Return the longest hold-up, in seconds."""
        self._process.send_signal(signal.SIGTERM)
        out, _ = self._process.communicate()
        return float(out)


WITNESS = """
import signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: (print(worst), sys.exit()))
worst, last = 0.0, time.monotonic()
while True:
    time.sleep(0.005)
    now = time.monotonic()
    worst, last = max(worst, now - last - 0.005), now
"""


def until_still_s(trace: Trace, since_ns: int) -> float:
    """Return how long after a moment the board last received a command to move, in seconds."""
    moving = [c.mono_ns for c in trace.commands if c.kind == "run" and (c.linear or c.angular)]
    return max(0.0, (moving[-1] - since_ns) / NS_PER_S) if moving else 0.0
