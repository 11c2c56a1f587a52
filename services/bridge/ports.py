"""Which of our two UDP ports each kind of frame is taken from.

The board sends to both ports (manual 1), but the manual marks the velocity "S0, S1" and queries
"S1": which frame comes where is open. So each kind of frame has an active port of its own:

================================= =================================================================
a frame comes                     it is
================================= =================================================================
to the active port, or is the     taken
first of its kind
to the other port                 dropped as a copy, unless the active port has been silent: no such
                                  frame for the patience of its kind, or no frame at all for the
                                  failover time; then it is taken, and its port becomes active
to the other port, and is urgent  taken, and its port becomes active: a bumper hit or a driver fault
                                  that is not known yet counts from either port
================================= =================================================================

So no datagram is taken twice, and the link survives one dead port. Commands leave from the port
that the velocity comes to: it comes unasked, and the board is assumed to take commands from where
it sends to. A query leaves from the port that its answers come to; while there are none for half a
second, or for the patience of a slow one, from the ports in turn.
"""

from collections.abc import Mapping

from msgspec import Struct

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from common.wire.reports import BumperReport, VelocityReport

UNANSWERED_NS = NS_PER_S // 2
PERIODS = 2.5  # without a frame of its kind, until the other port is taken


class Stream(Struct):
    """Where one kind of frame comes from, and when it came last."""

    port: int
    heard_ns: int


class Ports:
    """Chooses a port for each kind of frame; ports are counted from 0."""

    def __init__(
        self, count: int, failover_ns: int, rates_hz: Mapping[type[Frame], float], now_ns: int
    ) -> None:
        """Take how many ports there are, and how often each kind of frame is asked for."""
        self.main = 0  # where commands leave from
        self._count = count
        self._failover_ns = failover_ns
        self._patience_ns = {
            kind: max(failover_ns, round(PERIODS / rate_hz * NS_PER_S))
            for kind, rate_hz in rates_hz.items()
        }
        self._began_ns = now_ns
        self._heard_ns = [now_ns] * count
        self._streams: dict[type[Frame], Stream] = {}

    def takes(self, kind: type[Frame], port: int, now_ns: int) -> bool:
        """Note that a frame came to a port, and return whether it counts."""
        self._heard_ns[port] = now_ns
        stream = self._streams.get(kind)
        if stream is None or stream.port == port:
            return True
        patience_ns = self._patience_ns.get(kind, self._failover_ns)
        return (
            now_ns - stream.heard_ns > patience_ns
            or now_ns - self._heard_ns[stream.port] > self._failover_ns
        )

    def take(self, kind: type[Frame], port: int, now_ns: int) -> bool:
        """Take a frame from a port; return whether its kind came from another one before."""
        if kind is VelocityReport or VelocityReport not in self._streams:
            self.main = port
        stream = self._streams.get(kind)
        if stream is None:
            self._streams[kind] = Stream(port, now_ns)
            return False
        changed = stream.port != port
        stream.port, stream.heard_ns = port, now_ns
        return changed

    def to_ask(self, answer: type[Frame], now_ns: int) -> int:
        """Return the port from which to ask for this kind of answer."""
        patience_ns = self._patience_ns.get(answer)
        if patience_ns is None:  # asked rarely: where the answers of polls arrive
            stream = self._streams.get(BumperReport)
            return self.main if stream is None else stream.port
        stream = self._streams.get(answer)
        port, since_ns = (
            (self.main, self._began_ns) if stream is None else (stream.port, stream.heard_ns)
        )
        turn_ns = max(UNANSWERED_NS, patience_ns)
        return (port + max(0, now_ns - since_ns) // turn_ns) % self._count

    def is_heard(self, kind: type[Frame], now_ns: int) -> bool:
        """Return whether this kind of frame came within the last half second."""
        stream = self._streams.get(kind)
        return stream is not None and now_ns - stream.heard_ns <= UNANSWERED_NS

    def by_name(self) -> dict[str, int]:
        """Return the port of each kind of frame that ever came, by the kind's name."""
        return {kind.__name__: stream.port for kind, stream in self._streams.items()}
