"""``python -m verification.faults.programs ENDPOINT NAME``: the programs beside the stack.

``driver`` reads speeds in m/s from standard input, one a line.
"""

import contextlib
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping

from verification.faults.independent_client import Client, Source, session

PER_MS = 20  # datagrams of the flood


@contextlib.contextmanager
def source(endpoint: str, key: str) -> Iterator[Source]:
    """Connect a source of this key."""
    with session(endpoint) as bus, contextlib.closing(Source(Client(bus), key)) as made:
        yield made


def driver(endpoint: str) -> None:
    """Request the last speed at 20 Hz."""
    with source(endpoint, "@cmd/drive/teleop") as made:
        for line in sys.stdin:
            made.repeat(linear=float(line), angular=0.0)


def limiter(endpoint: str) -> None:
    """Publish a limit without a restriction."""
    with source(endpoint, "@cmd/limit/lidar") as made:
        made.repeat()
        threading.Event().wait()


def pendant(endpoint: str) -> None:
    """Publish the keepalive of a pendant."""
    with source(endpoint, "@cmd/estop_keepalive/pendant") as made:
        made.repeat()
        threading.Event().wait()


def flood(address: str) -> None:
    """Send 20 000 datagrams/s to an address, host:port."""
    host, _, port = address.partition(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect((host, int(port)))
        due_s = time.monotonic()
        while True:
            for _ in range(PER_MS):
                with contextlib.suppress(OSError):
                    sock.send(b"GS" + bytes(20))
            due_s = max(due_s + 0.001, time.monotonic() - 0.1)
            time.sleep(max(0.0, due_s - time.monotonic()))


PROGRAMS: Mapping[str, Callable[[str], None]] = {
    program.__name__: program for program in (driver, limiter, pendant, flood)
}

if __name__ == "__main__":
    PROGRAMS[sys.argv[2]](sys.argv[1])
