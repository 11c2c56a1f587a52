"""``python -m bench.growth.publisher_pair ENDPOINT BYTES HZ``: a publisher and a subscriber.

Plain Zenoh sessions at a router; messages of BYTES each.
"""

import itertools
import struct
import sys
import threading
import time

import zenoh

from bench.load.consumer import plain
from common import clock
from verification.harness.child_process import serve

HEAD = struct.Struct("<QQ")  # number and time of sending: the smallest message
KEY = "t2/v1/001/tel/bench"


class Receiver:
    """Records age and number of each message."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Reset the counts."""
        self.ages_ns: list[int] = []
        self.numbers: list[int] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message."""
        number, sent_ns = HEAD.unpack_from(sample.payload.to_bytes())
        self.ages_ns.append(clock.now_ns() - sent_ns)
        self.numbers.append(number)

    def end(self) -> object:
        """Return the ages, and the share that arrived."""
        numbers, ages_ns = (
            list(self.numbers),
            list(self.ages_ns),
        )  # copies: the other thread appends
        sent = max(numbers) - min(numbers) + 1 if numbers else 1
        return {
            "ages_ns": ages_ns,
            "arrived": len(numbers) / sent,
        }


def main() -> None:
    """Publish until standard input ends."""
    endpoint, *numbers = sys.argv[1:]
    size, hz = map(int, numbers)
    receiver, left = Receiver(), threading.Event()
    with zenoh.open(plain(endpoint)) as near, zenoh.open(plain(endpoint)) as far:
        declared = far.declare_subscriber(KEY, receiver.take)
        serve(receiver.begin, receiver.end, left.set)
        put(near, bytes(size - HEAD.size), hz, left)
        declared.undeclare()


def put(session: zenoh.Session, rest: bytes, hz: float, left: threading.Event) -> None:
    """Publish at a rate until stopped."""
    due_s = time.monotonic()
    for number in itertools.count():
        if left.wait(max(0.0, due_s - time.monotonic())):
            return
        head = HEAD.pack(number, clock.now_ns())
        session.put(KEY, head + rest, congestion_control=zenoh.CongestionControl.DROP)
        due_s += 1 / hz


if __name__ == "__main__":
    main()
