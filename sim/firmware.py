"""Output of the board's firmware: which frames leave, on which ports, in which datagrams.

The manual leaves this open: it draws one frame in each datagram, and names two ports of the PC
without saying which of them an answer takes.
"""

import random
from collections import Counter, defaultdict
from collections.abc import Sequence

from common.wire import reports as r
from common.wire.frame import Frame
from common.wire.framing import Framing
from sim.config import Firmware
from sim.faults import Datagram
from sim.requests import Where

ECHOES = (r.UltrasonicBrakeReport, r.BumperBrakeReport)


class Output:
    """Packs frames for the PC; ``settings`` and ``muted`` may change while it runs."""

    def __init__(self, settings: Firmware, framing: Framing, ports: Sequence[int], seed: int):
        self.settings = settings
        self.muted: frozenset[type[Frame]] = frozenset()
        self._framing = framing
        self._ports = ports
        self._random = random.Random(f"firmware {seed}")
        self._loss: tuple[frozenset[type[Frame]], int] = frozenset(), 1
        self._loss_counts: Counter[type[Frame]] = Counter()
        self._waiting: dict[int, bytes] = defaultdict(bytes)  # by port, to be merged

    def lose(self, reports: frozenset[type[Frame]], every: int) -> None:
        """Drop every n-th of these reports from now on."""
        self._loss = reports, every
        self._loss_counts.clear()

    def answer(self, frame: Frame, asked: int) -> list[Datagram]:
        """Return the datagrams of an answer to a query from this port; none for one held back."""
        if isinstance(frame, ECHOES) and not self.settings.echoes:
            return []
        where = self.settings.answers
        if isinstance(frame, r.BumperReport) and frame.on and self.settings.hits != "answers":
            where = self.settings.hits
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
            if type(frame) in self.muted or self._is_lost(type(frame)):
                continue
            payload = self._framing.pack(frame)
            if self.settings.merge:
                self._waiting[port] += payload
                continue
            datagrams += [Datagram(part, port) for part in self._parts(payload)]
        return datagrams

    def _parts(self, payload: bytes) -> Sequence[bytes]:
        if not self.settings.split or self._random.random() >= self.settings.split:
            return (payload,)
        cut = self._random.randrange(1, len(payload))
        return payload[:cut], payload[cut:]

    def _is_lost(self, kind: type[Frame]) -> bool:
        kinds, every = self._loss
        if kind not in kinds:
            return False
        self._loss_counts[kind] += 1
        return self._loss_counts[kind] % every == 0
