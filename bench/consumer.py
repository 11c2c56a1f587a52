"""``python -m bench.consumer ENDPOINT KEY ...``: a consumer without T2, as a child process.

Plain zenoh and msgpack, in Zenoh's own thread. It records counts, bytes, losses and ages.
"""

import sys
import threading
import time
from typing import Any

import msgpack
import zenoh

from bench.zenoh_pair import connected
from common import clock
from verification.harness.child_process import serve

AGES_MAX = 1000  # reported, evenly spread


class Consumer:
    """Counts from ``begin`` on."""

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}
        self.begin()

    def begin(self) -> None:
        """Reset the counts."""
        self._bytes = self._lost = 0
        self._ages_ns: list[int] = []
        self._since_s = time.monotonic()

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message, payload and attachment."""
        payload, key = sample.payload.to_bytes(), str(sample.key_expr)
        message: dict[str, Any] = msgpack.unpackb(payload)
        self._ages_ns.append(clock.now_ns() - message["mono_ns"])
        self._bytes += len(payload) + (len(sample.attachment) if sample.attachment else 0)
        before = self._newest.get(key, message["seq"] - 1)
        self._lost += max(0, message["seq"] - before - 1)
        self._newest[key] = message["seq"]

    def end(self) -> object:
        """Return the counts, per second, and the ages."""
        past_s = time.monotonic() - self._since_s
        count = len(self._ages_ns)
        return {
            "hz": count / past_s,
            "bytes_per_s": self._bytes / past_s,
            "lost": self._lost / max(1, count + self._lost),
            "ages_ns": self._ages_ns[:: max(1, count // AGES_MAX)],
        }


def main() -> None:
    """Consume until standard input ends."""
    endpoint, *keys = sys.argv[1:]
    consumer, left = Consumer(), threading.Event()
    with connected(endpoint) as session:
        declared = [session.declare_subscriber(key, consumer.take) for key in keys]
        serve(consumer.begin, consumer.end, left.set)
        left.wait()
        for each in declared:
            each.undeclare()


if __name__ == "__main__":
    main()
