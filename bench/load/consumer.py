"""``python -m bench.load.consumer ENDPOINT KEY``: a consumer without T2.

Plain zenoh and msgpack, in Zenoh's own thread. It records sequence numbers and ages.
"""

import json
import sys
import threading
from typing import Any

import msgpack
import zenoh

from common import clock
from verification.harness.child_process import serve

AGES_MAX = 1000  # reported, evenly spread


def plain(endpoint: str) -> zenoh.Config:
    """Return the configuration of a plain client."""
    settings = {"mode": "client", "connect": {"endpoints": [endpoint]}}
    return zenoh.Config.from_json5(json.dumps(settings))


class Consumer:
    """Counts from ``begin`` on."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Reset the counts."""
        self._seqs: dict[str, list[int]] = {}
        self._ages_ns: list[int] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message."""
        message: dict[str, Any] = msgpack.unpackb(sample.payload.to_bytes())
        self._ages_ns.append(clock.now_ns() - message["mono_ns"])
        self._seqs.setdefault(str(sample.key_expr), []).append(message["seq"])

    def end(self) -> object:
        """Return for each key the count, the first and the last number; and the ages."""
        came = {
            key: list(seqs) for key, seqs in list(self._seqs.items())
        }  # copies: the other thread appends
        every = max(1, len(self._ages_ns) // AGES_MAX)
        return {
            "keys": {key: (len(seqs), seqs[0], seqs[-1]) for key, seqs in came.items() if seqs},
            "ages_ns": self._ages_ns[::every],
        }


def main() -> None:
    """Consume until standard input ends."""
    endpoint, key = sys.argv[1:]
    consumer, left = Consumer(), threading.Event()
    with zenoh.open(plain(endpoint)) as session:
        declared = session.declare_subscriber(key, consumer.take)
        serve(consumer.begin, consumer.end, left.set)
        left.wait()
        declared.undeclare()


if __name__ == "__main__":
    main()
