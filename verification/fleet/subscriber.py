"""``python -m verification.fleet.subscriber SITE WHAT``: count messages at a site."""

import sys
import threading
import time
from collections import Counter

import msgspec
import zenoh

from common import clock, keys
from common.bus.session import client_config
from common.messages import Message
from verification.harness.bus import at
from verification.harness.child_process import serve

# Key expressions of each subscription at the site.
PATHS = {
    "nothing": (),
    "overview": (keys.SAFETY.path, keys.LINK.path, "evt/*"),
    "everything": ("tel/**", "evt/*"),
}
AGE_EVERY = 5  # the age of every n-th message is recorded

_decoder = msgspec.msgpack.Decoder(Message)


class MessageCounter:
    """Counts messages, bytes, losses and ages, in Zenoh's thread."""

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}
        self.begin()

    def begin(self) -> None:
        self._count = self._bytes = self._lost = 0
        self._keys: set[str] = set()
        self._ages_s: list[float] = []
        self._since_s = time.monotonic()

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message."""
        payload = sample.payload.to_bytes()
        head = _decoder.decode(payload)
        key = str(sample.key_expr)
        self._count += 1
        self._bytes += len(payload)
        self._keys.add(key)
        before = self._newest.get(key, head.seq - 1)
        self._lost += max(0, head.seq - before - 1)
        self._newest[key] = head.seq
        if self._count % AGE_EVERY == 0:
            self._ages_s.append((clock.now_ns() - head.mono_ns) / 1e9)

    def end(self) -> object:
        """Return the counts; ``lost`` includes messages that downsampling dropped."""
        past_s = time.monotonic() - self._since_s
        robots = Counter(key.split("/")[2] for key in self._keys)
        return {
            "hz": self._count / past_s,
            "bytes_per_s": self._bytes / past_s,
            "lost_hz": self._lost / past_s,
            "robots": len(robots),
            "ages_s": self._ages_s,
        }


def main() -> None:
    """Count until standard input ends."""
    site, what = sys.argv[1:]
    counter, left = MessageCounter(), threading.Event()
    with zenoh.open(client_config(at(site))) as session:
        declared = [
            session.declare_subscriber(f"{keys.ROOT}/*/{path}", counter.take)
            for path in PATHS[what]
        ]
        serve(counter.begin, counter.end, left.set)
        left.wait()
        for each in declared:
            each.undeclare()


if __name__ == "__main__":
    main()
