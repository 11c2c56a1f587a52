"""Simulated cable: one direction between board and PC, with datagram faults.

Faults apply to each datagram in this order: dropped, corrupted, duplicated, queued by the rate
limit, delayed. Datagrams without delay are delivered at once and in order.
"""

import heapq
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

from common.freshness import NS_PER_S
from sim.model import Line

QUEUE = 65536  # bytes that may wait for a limited rate; more are dropped
NONE = Line()


@dataclass(frozen=True, slots=True)
class Datagram:
    """Bytes from or to one of the PC's ports."""

    payload: bytes
    port: int  # of the PC, in ``board.listen_ports``


class Cable:
    """One direction; a datagram is taken out when it is due.

    ports: the PC's; needed only by faults of one of them.
    """

    def __init__(self, seed: int, faults: Line = NONE, ports: Sequence[int] = ()) -> None:
        self.faults = faults
        self._ports = ports
        self._random = random.Random(seed)
        self._under_way: list[tuple[int, int, Datagram]] = []  # due, order, datagram
        self._order = 0
        self._free_ns = 0  # when all queued data has left

    def put(self, datagram: Datagram, now_ns: int) -> None:
        """Send a datagram."""
        faults = self.faults if self._affects(datagram.port) else NONE
        if self._happens(faults.drop):
            return
        if self._happens(faults.corrupt):
            datagram = replace(datagram, payload=self._flip(datagram.payload))
        for _ in range(2 if self._happens(faults.duplicate) else 1):
            left_ns = self._leaves_ns(faults, len(datagram.payload), now_ns)
            if left_ns is not None:
                late = self._random.uniform(0.0, faults.jitter) if faults.jitter else 0.0
                due_ns = left_ns + round((faults.delay + late) * NS_PER_S)
                heapq.heappush(self._under_way, (due_ns, self._order, datagram))
                self._order += 1

    def take(self, now_ns: int) -> list[Datagram]:
        """Return what has arrived by now, in the order of arrival."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now_ns:
            arrived.append(heapq.heappop(self._under_way)[2])
        return arrived

    @property
    def due_ns(self) -> int | None:
        """Return when the next one arrives; None when nothing is under way."""
        return self._under_way[0][0] if self._under_way else None

    def _affects(self, port: int) -> bool:
        """Return whether the faults are those of this port of the PC."""
        which = self.faults.port
        return which == "both" or port == self._ports[0 if which == "first" else -1]

    def _leaves_ns(self, faults: Line, size: int, now_ns: int) -> int | None:
        """Return when so many bytes have left, after all before them; None if none may wait."""
        if faults.rate is None:
            return now_ns
        a_byte_ns = 8 * NS_PER_S / faults.rate
        begins_ns = max(now_ns, self._free_ns)
        if (begins_ns - now_ns) / a_byte_ns + size > QUEUE:
            return None
        self._free_ns = begins_ns + round(size * a_byte_ns)
        return self._free_ns

    def _happens(self, chance: float) -> bool:
        # Nothing is drawn for what cannot happen: switching one fault on leaves the others' draws.
        return chance > 0 and self._random.random() < chance

    def _flip(self, payload: bytes) -> bytes:
        if not payload:
            return payload
        flipped = bytearray(payload)
        for _ in range(self._random.randint(1, 3)):
            flipped[self._random.randrange(len(flipped))] ^= 1 << self._random.randrange(8)
        return bytes(flipped)
