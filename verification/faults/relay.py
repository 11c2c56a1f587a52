"""A relay between the stack and the simulated board, and what happens to the three of them.

The relay has its own network namespace with a cable to each side. Stack and board share the
campaign's: each has its own address and cable there, and all their datagrams cross the relay.
"""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Literal

from cli.settings import Everything
from common import clock
from verification.harness.network_hosts import ip
from verification.harness.process_stats import children

if TYPE_CHECKING:
    from verification.faults.stack_fixture import StackFixture

Side = Literal["pc", "board"]

HOST = f"t2relay{os.getpid()}"
REPORT_PORT = 4010
ADDRESSES = {"pc": ("10.7.6.2", "10.7.6.1"), "board": ("10.7.5.224", "10.7.5.220")}
PC_SETS = ["board.address=10.7.6.1", "board.listen_address=10.7.6.2",
           f"board.relay_port={REPORT_PORT}"]  # fmt: skip
SIM_SETS = ["board.address=10.7.5.224", "board.listen_address=10.7.5.220", "board.relay_port=0"]
OTHERS = ("sim", "relay", "driver")  # processes that do not run on the PC


@contextlib.contextmanager
def cables() -> Iterator[None]:
    """Make the relay's host and its two cables."""
    ip("netns", "add", HOST)
    try:
        ip("-n", HOST, "link", "set", "lo", "up")
        for side, (there, ours) in ADDRESSES.items():
            ip("link", "add", f"cable-{side}", "type", "veth", "peer", "name", side, "netns", HOST)
            ip("address", "add", f"{there}/24", "dev", f"cable-{side}")
            ip("link", "set", f"cable-{side}", "up")
            ip("-n", HOST, "address", "add", f"{ours}/24", "dev", side)
            ip("-n", HOST, "link", "set", side, "up")
        yield
    finally:
        ip("netns", "del", HOST)


def command(config: Everything) -> dict[str, list[str]]:
    """Return the command of the relay."""
    ports = map(str, config.board.listen_ports)
    relay = [sys.executable, "-m", "services.relay", "--board-port", str(config.board.port)]
    return {"relay": ["ip", "netns", "exec", HOST, *relay, "--ports", *ports]}


def pc_pids(fixture: "StackFixture") -> list[int]:
    """Return all processes of the PC, parents first: a guard must not see its bridge stop."""
    processes = fixture.running.processes
    parents = [process.pid for name, process in processes.items() if name not in OTHERS]
    return [*parents, *(child for parent in parents for child in children(parent))]


def stop_pc(fixture: "StackFixture") -> int:
    """Stop all processes of the PC, as when its kernel hangs."""
    at_ns = clock.now_ns()
    for pid in pc_pids(fixture):
        os.kill(pid, signal.SIGSTOP)
    return at_ns


def continue_pc(fixture: "StackFixture") -> None:
    """Continue all processes of the PC."""
    for pid in pc_pids(fixture):
        os.kill(pid, signal.SIGCONT)
    fixture.restore()


def kill_pc(fixture: "StackFixture") -> int:
    """Kill all processes of the PC, stopped first: none reacts to the end of another."""
    pids = pc_pids(fixture)
    at_ns = stop_pc(fixture)
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    return at_ns


def cut(side: Side, seconds: float) -> Callable[["StackFixture"], int]:
    """Cut one of the two cables for some time."""

    def inject(_: "StackFixture") -> int:
        at_ns = clock.now_ns()
        ip("link", "set", f"cable-{side}", "down")
        time.sleep(seconds)
        ip("link", "set", f"cable-{side}", "up")
        return at_ns

    return inject


def restart(after_s: float) -> Callable[["StackFixture"], int]:
    """Kill the relay, and start it again as a supervisor does."""

    def inject(fixture: "StackFixture") -> int:
        at_ns = fixture.running.kill("relay")
        time.sleep(after_s)
        fixture.running.start("relay")
        return at_ns

    return inject
