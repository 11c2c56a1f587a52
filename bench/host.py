"""``python -m bench.host``: how late this host wakes a process that only sleeps.

It runs beside each row with the highest priority of the chain, where that is granted, so what it
waits for is the host. It sleeps 2 ms at a time. A child process that answers with the
delays since ``begin``, in ns.
"""

import contextlib
import threading
import time
from collections.abc import Iterator

from bench.child_process import ChildProcess, serve
from bench.figures import PERIOD_NS
from common import realtime
from common.freshness import NS_PER_S


@contextlib.contextmanager
def watched(late_ns: list[int]) -> Iterator[None]:
    """Add the delays of the host during this context to a list, in ns, at its end."""
    with ChildProcess("bench.host") as sleeper:
        sleeper.send("begin")
        yield
        late_ns += sleeper.end()


def main() -> None:
    """Sleep until standard input ends."""
    realtime.request(realtime.BOARD, alone=True)
    late_ns, left = list[int](), threading.Event()
    serve(late_ns.clear, lambda: list(late_ns), left.set)
    while not left.is_set():
        since_ns = time.monotonic_ns()
        time.sleep(PERIOD_NS / NS_PER_S)
        late_ns.append(time.monotonic_ns() - since_ns - PERIOD_NS)


if __name__ == "__main__":
    main()
