"""Free ports on loopback, disjoint between the workers of a test run."""

import contextlib
import itertools
import os
import random
import socket
from collections.abc import Iterator

WORKERS = 8  # workers with disjoint port ranges


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """Return a free port of 127.0.0.1; no other caller in this run gets the same port soon."""
    while True:
        port = next(PORTS)
        with socket.socket(socket.AF_INET, kind) as sock, contextlib.suppress(OSError):
            sock.bind(("127.0.0.1", port))
            return port


def ports() -> Iterator[int]:
    """Yield the ports of this process in a cycle, from a random start.

    They lie below the kernel's ephemeral range (from 32768). Each pytest-xdist worker has its own.
    """
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % WORKERS
    mine = range(10_000 + worker, 32_000, WORKERS)
    first = random.randrange(len(mine))
    return itertools.cycle([*mine[first:], *mine[:first]])


PORTS = ports()


def udp_ports(count: int) -> list[int]:
    """Return this many free UDP ports."""
    return [free_port(socket.SOCK_DGRAM) for _ in range(count)]
