"""``python -m bench.load.byte_counter ENDPOINT``: a consumer of everything that counts bytes.

Plain zenoh, like one laptop. It counts payloads and attachments, without keys and headers.
"""

import sys
import threading

import zenoh

from bench.load.consumer import plain
from common import keys
from verification.harness.child_process import serve

EVERYTHING = f"{keys.ROOT}/**"


class ByteCounter:
    """Counts from ``begin`` on."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Reset the counts."""
        self._bytes = self._messages = 0

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message."""
        self._bytes += len(sample.payload)
        self._bytes += len(sample.attachment) if sample.attachment else 0
        self._messages += 1

    def end(self) -> object:
        """Return the counts."""
        return {"bytes": self._bytes, "messages": self._messages}


def main() -> None:
    """Count until standard input ends."""
    counter, left = ByteCounter(), threading.Event()
    with zenoh.open(plain(sys.argv[1])) as session:
        callback = zenoh.handlers.Callback(counter.take, indirect=False)
        declared = session.declare_subscriber(EVERYTHING, callback)
        serve(counter.begin, counter.end, left.set)
        left.wait()
        declared.undeclare()


if __name__ == "__main__":
    main()
