"""The chain on board as processes of its own, each known by its name."""

import contextlib
import socket
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from bench.path.processes import robots_python
from verification.harness.bus import router_process
from verification.harness.ports import free_port
from verification.harness.process_stats import tree
from verification.harness.waiting import wait_until

CHAIN = ("bridge", "safety", "odom")


@dataclass(frozen=True, slots=True)
class Ports:
    """Where board, bridge and router listen on loopback."""

    board: int = field(default_factory=lambda: free_port(socket.SOCK_DGRAM))
    bridge: int = field(default_factory=lambda: free_port(socket.SOCK_DGRAM))
    standby: int = field(default_factory=lambda: free_port(socket.SOCK_DGRAM))
    router: int = field(default_factory=free_port)

    @property
    def endpoint(self) -> str:
        """Where the bus is."""
        return f"tcp/127.0.0.1:{self.router}"

    @property
    def sets(self) -> list[str]:
        """The settings that say so, as options of a service."""
        texts = (
            f"board.port={self.board}",
            f"board.listen_ports=[{self.bridge}, {self.standby}]",
            f"bus.listen={self.endpoint}",
        )
        return [word for text in texts for word in ("--set", text)]


Pids = dict[str, int]  # of each process, the guard's and its bridge's apart


@contextlib.contextmanager
def stack(ports: Ports, services: Sequence[str] = CHAIN) -> Iterator[Pids]:
    """Run router and services while the context lasts, each as shipped."""
    python = robots_python()
    with contextlib.ExitStack() as held:
        pids = {"router": held.enter_context(router_process(ports.endpoint, python)).pid}
        for name in services:
            command = [python, "-m", f"services.{name}", *ports.sets]
            process = held.enter_context(subprocess.Popen(command, stderr=subprocess.DEVNULL))
            held.callback(process.kill)
            pids[name] = process.pid
        guard = pids["bridge"]
        yield pids | {"guard": guard, "bridge": guarded(guard)}


def guarded(guard: int) -> int:
    """Return the bridge under a guard, as soon as there is one."""
    found = wait_until(lambda: [pid for _, pid in tree("", guard)][1:], "a bridge under its guard")
    return found[0]
