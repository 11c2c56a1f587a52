"""``python -m bench.growth.pair ENDPOINT KEYS BYTES HZ``: one who puts, and who subscribes.

Plain zenoh, sessions at a router. So many keys are subscribed to; a message of so many bytes goes
to one of them after the other.
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
from verification.fleet.child import obey

HEAD = struct.Struct("<QQ")  # number and time of sending; the least that a message has
KEY = "t2/v1/001/tel/bench/{}"
# Keys of a session: the time that Zenoh's client takes to declare them grows with their square.
SHARE = 500


class Ear:
    """Takes the age of what comes."""

    def __init__(self) -> None:
        self.declared_s = 0.0  # how long that took, of all keys
        self.begin()

    def begin(self) -> None:
        """Forget what was."""
        self.ages_ns: list[int] = []
        self.numbers: list[int] = []

    def take(self, sample: zenoh.Sample) -> None:
        """Take one in."""
        number, sent_ns = HEAD.unpack_from(sample.payload.to_bytes())
        self.ages_ns.append(time.monotonic_ns() - sent_ns)
        self.numbers.append(number)

    def end(self) -> object:
        """Tell it, which share arrived, and how long it took to declare all keys."""
        numbers, ages_ns = list(self.numbers), list(self.ages_ns)  # more is coming meanwhile
        sent = max(numbers) - min(numbers) + 1 if numbers else 1
        return {
            "ages_ns": ages_ns,
            "arrived": len(numbers) / sent,
            "declared_s": self.declared_s,
        }


def main() -> None:
    """Put until standard input ends."""
    endpoint, *numbers = sys.argv[1:]
    keys, size, hz = map(int, numbers)
    names = [KEY.format(number) for number in range(keys)]
    ear, left = Ear(), threading.Event()
    with contextlib.ExitStack() as held:
        near = held.enter_context(zenoh.open(plain(endpoint)))
        declared, begin_s = [], time.monotonic()
        for first in range(0, keys, SHARE):
            far = held.enter_context(zenoh.open(plain(endpoint)))
            declared += [
                far.declare_subscriber(name, ear.take) for name in names[first : first + SHARE]
            ]
        ear.declared_s = time.monotonic() - begin_s
        obey(ear.begin, ear.end, left.set)
        put(near, names, bytes(size - HEAD.size), hz, left)


def put(
    session: zenoh.Session, names: Sequence[str], rest: bytes, hz: float, left: threading.Event
) -> None:
    """Put by the clock, to one key after the other, until told to leave."""
    due_s = time.monotonic()
    for number, name in enumerate(itertools.cycle(names)):
        if left.wait(max(0.0, due_s - time.monotonic())):
            return
        head = HEAD.pack(number, time.monotonic_ns())
        session.put(name, head + rest, congestion_control=zenoh.CongestionControl.DROP)
        due_s += 1 / hz


if __name__ == "__main__":
    main()
