"""Independent cable: datagrams of each port lost, doubled, late, split or merged."""

import heapq
import itertools
import random
from collections import defaultdict
from dataclasses import dataclass


@dataclass(frozen=True)
class Port:
    """What happens to the datagrams of one port, either way; chances are those of a datagram."""

    lost: float = 0.0
    doubled: float = 0.0
    delay: float = 0.0  # s
    jitter: float = 0.0  # s


GOOD = (Port(), Port())


class Cable:
    """One direction of both ports."""

    def __init__(self) -> None:
        self._under_way: list[tuple[float, int, bytes, int]] = []
        self._number = itertools.count()

    def put(self, datagram: bytes, index: int, port: Port, now: float) -> None:
        """Send a datagram on the port of this index."""
        if random.random() < port.lost:
            return
        for _ in range(2 if random.random() < port.doubled else 1):
            due = now + port.delay + random.uniform(0.0, port.jitter)
            heapq.heappush(self._under_way, (due, next(self._number), datagram, index))

    def take(self, now: float) -> list[tuple[bytes, int]]:
        """Return what has arrived, with the index of its port."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now:
            _, _, datagram, index = heapq.heappop(self._under_way)
            arrived.append((datagram, index))
        return arrived


@dataclass
class Packing:
    """How the firmware packs frames into datagrams; by default each has its own."""

    split: float = 0.0  # chance that a frame comes in two
    merge: float = 0.0  # s that frames wait for each other

    def __post_init__(self) -> None:
        self._waiting: dict[int, bytes] = defaultdict(bytes)
        self._due = 0.0

    def pack(self, frame: bytes, index: int) -> list[bytes]:
        """Return the datagrams of a frame that leave at once."""
        if self.merge:
            self._waiting[index] += frame
            return []
        if random.random() < self.split:
            cut = random.randint(1, len(frame) - 1)
            return [frame[:cut], frame[cut:]]
        return [frame]

    def collected(self, now: float) -> list[tuple[bytes, int]]:
        """Return the datagrams of frames that waited long enough."""
        if not self._waiting or now < self._due:
            return []
        self._due = now + self.merge
        waiting, self._waiting = self._waiting, defaultdict(bytes)
        return [(datagram, index) for index, datagram in waiting.items()]
