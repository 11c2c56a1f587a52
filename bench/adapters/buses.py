"""The other buses: the router that each needs, and its adapter."""

import contextlib
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass

from bench.path.processes import Command, module, one_pool, running
from verification.harness.bus import set_options
from verification.harness.ports import free_port


@dataclass(frozen=True, slots=True)
class OtherBus:
    """A bus; its context runs the router, if any, and yields the address."""

    title: str
    name: str  # of its adapter
    run: Callable[[], AbstractContextManager[str]]
    package: str = ""  # required, by its name in requirements-bench.lock
    pooled: bool = False  # Zenoh's runtimes share one pool of threads, as in T2's services

    def module(self, name: str, *words: object) -> Command:
        """Return the command of a process on this bus."""
        command = module(name, *words)
        return one_pool(command) if self.pooled else command


@contextlib.contextmanager
def udp() -> Iterator[str]:
    """Yield a UDP port."""
    yield str(free_port(socket.SOCK_DGRAM))


@contextlib.contextmanager
def dds() -> Iterator[str]:
    """Yield an unused domain."""
    yield str(1 + free_port() % 200)


@contextlib.contextmanager
def zenoh() -> Iterator[str]:
    """Run the T2 router as shipped, with SCHED_FIFO."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with running(module("cli router", *set_options(f"bus.listen={endpoint}"))):
        yield endpoint


@contextlib.contextmanager
def direct() -> Iterator[str]:
    """Yield the endpoint on which the process at the board listens."""
    yield f"tcp/127.0.0.1:{free_port()}"


UDP = OtherBus("UDP", "udp", udp)
DDS = OtherBus("CycloneDDS", "dds", dds, "cyclonedds")
ZENOH = OtherBus("Zenoh, a router", "zenoh", zenoh)
POOLED = OtherBus("Zenoh, a router, one pool", "zenoh", zenoh, pooled=True)
DIRECT = OtherBus("Zenoh, direct", "zenoh_direct", direct)
OTHERS = (DDS, ZENOH, POOLED)
