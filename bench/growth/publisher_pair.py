"""``python -m bench.growth.publisher_pair ENDPOINT KEYS BYTES HZ``: a publisher and a subscriber.

Plain Zenoh sessions at a router. The messages, BYTES each, go to the KEYS in rotation.
"""

import contextlib
import itertools
import struct
import sys
import threading
import time
from collections.abc import Sequence

import zenoh

from bench.load.consumer import plain
from verification.harness.child_process import serve

HEAD = struct.Struct("<QQ")  # number and time of sending: the smallest message
KEY = "t2/v1/001/tel/bench/{}"
# Zenoh's client takes quadratic time to declare the keys of a session.
KEYS_PER_SESSION = 500


class Receiver:
    """Records age and number of each message."""

    def __init__(self) -> None:
        self.declared_s = 0.0  # to declare all keys
        self.begin()

    def begin(self) -> None:
        """Reset the counts."""
        self.ages_ns: list[int] = []
        self.numbers: list[int] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message."""
        number, sent_ns = HEAD.unpack_from(sample.payload.to_bytes())
        self.ages_ns.append(time.monotonic_ns() - sent_ns)
        self.numbers.append(number)

    def end(self) -> object:
        """Return the ages, the share that arrived, and the time to declare all keys."""
        numbers, ages_ns = (
            list(self.numbers),
            list(self.ages_ns),
        )  # copies: the other thread appends
        sent = max(numbers) - min(numbers) + 1 if numbers else 1
        return {
            "ages_ns": ages_ns,
            "arrived": len(numbers) / sent,
            "declared_s": self.declared_s,
        }


def main() -> None:
    """Publish until standard input ends."""
    endpoint, *numbers = sys.argv[1:]
    keys, size, hz = map(int, numbers)
    names = [KEY.format(number) for number in range(keys)]
    receiver, left = Receiver(), threading.Event()
    with contextlib.ExitStack() as held:
        near = held.enter_context(zenoh.open(plain(endpoint)))
        declared, begin_s = [], time.monotonic()
        for first in range(0, keys, KEYS_PER_SESSION):
            far = held.enter_context(zenoh.open(plain(endpoint)))
            declared += [
                far.declare_subscriber(name, receiver.take)
                for name in names[first : first + KEYS_PER_SESSION]
            ]
        receiver.declared_s = time.monotonic() - begin_s
        serve(receiver.begin, receiver.end, left.set)
        put(near, names, bytes(size - HEAD.size), hz, left)


def put(
    session: zenoh.Session, names: Sequence[str], rest: bytes, hz: float, left: threading.Event
) -> None:
    """Publish at a rate to the keys in rotation, until stopped."""
    due_s = time.monotonic()
    for number, name in enumerate(itertools.cycle(names)):
        if left.wait(max(0.0, due_s - time.monotonic())):
            return
        head = HEAD.pack(number, time.monotonic_ns())
        session.put(name, head + rest, congestion_control=zenoh.CongestionControl.DROP)
        due_s += 1 / hz


if __name__ == "__main__":
    main()
