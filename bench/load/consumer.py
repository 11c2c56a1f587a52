"""``python -m bench.load.consumer ENDPOINT KEY``: a consumer with nothing of T2's in it.

Plain zenoh and msgpack, in Zenoh's own thread. It counts what comes, what was lost by the sequence
numbers, and how old each message is.
"""

import json
import sys
import threading
import time
from typing import Any

import msgpack
import zenoh

from verification.fleet.child import obey

TOLD = 1000  # ages at most, evenly spread


def plain(endpoint: str) -> zenoh.Config:
    """Return how anybody dials a router."""
    dials = {"mode": "client", "connect": {"endpoints": [endpoint]}}
    return zenoh.Config.from_json5(json.dumps(dials))


class Consumer:
    """Counts from ``begin`` on."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget what was."""
        self._seqs: dict[str, list[int]] = {}
        self._ages_ns: list[int] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Take one in."""
        message: dict[str, Any] = msgpack.unpackb(sample.payload.to_bytes())
        self._ages_ns.append(time.monotonic_ns() - message["mono_ns"])
        self._seqs.setdefault(str(sample.key_expr), []).append(message["seq"])

    def end(self) -> object:
        """Tell of each key how many came, and the first and the last number; and ages."""
        came = {key: list(seqs) for key, seqs in list(self._seqs.items())}  # more comes meanwhile
        every = max(1, len(self._ages_ns) // TOLD)
        return {
            "keys": {key: (len(seqs), seqs[0], seqs[-1]) for key, seqs in came.items() if seqs},
            "ages_ns": self._ages_ns[::every],
        }


def main() -> None:
    """Listen until standard input ends."""
    endpoint, key = sys.argv[1:]
    consumer, left = Consumer(), threading.Event()
    with zenoh.open(plain(endpoint)) as session:
        declared = session.declare_subscriber(key, consumer.take)
        obey(consumer.begin, consumer.end, left.set)
        left.wait()
        declared.undeclare()


if __name__ == "__main__":
    main()
