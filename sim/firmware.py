"""Output of the board's firmware: which frames leave, on which ports, in which datagrams.

The manual leaves this open: it draws one frame in each datagram, and names two ports of the PC
without saying which of them an answer takes.
"""

import random
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence

from common.wire import framing
from common.wire import reports as r
from common.wire.frame import Frame
from sim.faults import Datagram
from sim.model import Firmware, Where

CONFIRMATIONS = (r.UltrasonicBrakeReport, r.BumperBrakeReport)


class Output:
    """Packs frames for the PC; ``firmware`` may change while it runs."""

    def __init__(self, firmware: Firmware, ports: Sequence[int], seed: int):
        self.firmware = firmware
        self._ports = ports
        self._random = random.Random(f"firmware {seed}")
        self._muted: frozenset[type[Frame]] = frozenset()
        self._every = 1
        self._counts: Counter[type[Frame]] = Counter()
        self._waiting: dict[int, bytes] = defaultdict(bytes)  # by port, to be merged

    def mute(self, reports: Iterable[type[Frame]], every: int) -> None:
        """Suppress every n-th of these reports from now on."""
        self._muted, self._every = frozenset(reports), every
        self._counts.clear()

    def answer(self, frame: Frame, asked: int) -> list[Datagram]:
        """Return the datagrams of an answer to a query from this port; none for one held back."""
        if isinstance(frame, CONFIRMATIONS) and not self.firmware.confirms:
            return []
        where = self.firmware.answers
        if isinstance(frame, r.BumperReport) and frame.on:
            where = self.firmware.hits or where
        return self._pack(frame, self._addressed(where, asked))

    def unasked(self, frame: Frame) -> list[Datagram]:
        """Return the datagrams of a frame that is sent to all ports."""
        return self._pack(frame, self._ports)

    def merged(self) -> list[Datagram]:
        """Return the frames that waited for each other, one datagram for each port."""
        waiting, self._waiting = self._waiting, defaultdict(bytes)
        return [Datagram(payload, port) for port, payload in waiting.items()]

    def _addressed(self, where: Where, asked: int) -> Sequence[int]:
        ports = self._ports
        return {"asked": (asked,), "first": ports[:1], "second": ports[-1:], "both": ports}[where]

    def _pack(self, frame: Frame, ports: Sequence[int]) -> list[Datagram]:
        datagrams = []
        for port in ports:
            if self._is_muted(type(frame)):
                continue
            payload = framing.pack(frame)
            if self.firmware.merge:
                self._waiting[port] += payload
                continue
            datagrams += [Datagram(part, port) for part in self._parts(payload)]
        return datagrams

    def _parts(self, payload: bytes) -> Sequence[bytes]:
        if not self.firmware.split or self._random.random() >= self.firmware.split:
            return (payload,)
        cut = self._random.randrange(1, len(payload))
        return payload[:cut], payload[cut:]

    def _is_muted(self, kind: type[Frame]) -> bool:
        if kind not in self._muted:
            return False
        self._counts[kind] += 1
        return self._counts[kind] % self._every == 0
