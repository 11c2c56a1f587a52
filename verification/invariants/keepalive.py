"""A pendant, and the oracle's book on its messages delivered to one safety service.

Nothing in the book comes from the code under test.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from verification.invariants.net import Envelope
from verification.invariants.process import ROBOT, Process

PENDANT, TIMEOUT_S = "pendant", 1.0


class Pendant:
    """Publishes signs of life while it is alive."""

    def __init__(self, process: Process) -> None:
        self.process = process
        self.alive = True
        self.echo = 0
        self.seq = 0
        process.subscribe(keys.SAFETY, self._listen)

    def _listen(self, arrival: Any) -> None:
        self.echo = arrival.message.heartbeat

    def publish(self) -> None:
        """Publish one sign of life, if alive."""
        if self.alive:
            self.put(m.EstopKeepalive(echo=self.echo))

    def put(self, message: m.EstopKeepalive) -> None:
        """Put any message, with the next number."""
        self.seq += 1
        process = self.process
        boot = message.boot or process.boot
        message = msgspec.structs.replace(message, boot=boot, seq=self.seq)
        key = keys.ESTOP_KEEPALIVE.on(ROBOT, source=PENDANT)
        process.send(Envelope(key, message, process.boot, process.net.now_ns))


@dataclass(slots=True)
class KeepaliveBook:
    """The newest proof of life that one safety service received."""

    boot: int | None = None
    seq: int = 0
    proven_ns: int = 0  # when safety sent the heartbeat that was echoed last

    def on_message(self, message: m.SourceMessage, sent_ns: int | None, now_ns: int) -> bool:
        """Take a message in; return whether it shows a loss: a gap, or another program."""
        if sent_ns is None or now_ns - sent_ns > TIMEOUT_S * NS_PER_S:
            return False
        lost = self.is_lost(now_ns)
        broken = self.boot is not None and (lost or message.boot != self.boot)
        if message.boot != self.boot and (self.boot is None or lost):
            self.boot, self.seq = message.boot, message.seq - 1
        if message.boot == self.boot and message.seq > self.seq:
            self.seq, self.proven_ns = message.seq, sent_ns
        return broken

    def is_lost(self, now_ns: int) -> bool:
        """Return whether it was received once and is not alive now."""
        return self.boot is not None and now_ns - self.proven_ns > TIMEOUT_S * NS_PER_S

    def missing(self) -> Iterator[str]:
        """Yield a complaint while it was never received."""
        if self.boot is None:
            yield "no sign of life of the pendant"
