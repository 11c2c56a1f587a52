"""The stack on board as processes with known pids."""

import contextlib
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from bench.path.processes import robots_python
from verification.harness.bus import router_process, set_options
from verification.harness.ports import free_port, udp_ports
from verification.harness.process_stats import children
from verification.harness.waiting import wait_until

CHAIN = ("bridge", "safety", "odom")


@dataclass(frozen=True, slots=True)
class Ports:
    """Where board, bridge and router listen on loopback."""

    board: int = field(default_factory=lambda: udp_ports(1)[0])
    bridge: int = field(default_factory=lambda: udp_ports(1)[0])
    standby: int = field(default_factory=lambda: udp_ports(1)[0])
    router: int = field(default_factory=free_port)

    @property
    def endpoint(self) -> str:
        """Endpoint of the router."""
        return f"tcp/127.0.0.1:{self.router}"

    @property
    def sets(self) -> list[str]:
        """These ports as options of a service."""
        return set_options(
            f"board.port={self.board}",
            f"board.listen_ports=[{self.bridge}, {self.standby}]",
            f"bus.listen={self.endpoint}",
        )


Pids = dict[str, int]  # by process; guard and bridge separately


@contextlib.contextmanager
def stack(ports: Ports, services: Sequence[str] = CHAIN) -> Iterator[Pids]:
    """Run router and services, each as shipped."""
    python = robots_python()
    with contextlib.ExitStack() as held:
        pids = {"router": held.enter_context(router_process(ports.endpoint, python)).pid}
        for name in services:
            command = [python, "-m", f"services.{name}", *ports.sets]
            process = held.enter_context(subprocess.Popen(command, stderr=subprocess.DEVNULL))
            held.callback(process.kill)
            pids[name] = process.pid
        guard = pids["bridge"]
        yield pids | {"guard": guard, "bridge": bridge_pid(guard)}


def bridge_pid(guard: int) -> int:
    """Wait for the bridge under a guard; return its pid."""
    return wait_until(lambda: children(guard), "a bridge under its guard")[0]
