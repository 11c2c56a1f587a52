"""Port selection: the UDP port that each kind of frame is taken from. Pure.

The board sends to both ports (manual 1), but the manual marks the velocity "S0, S1" and queries
"S1": which frame uses which port is not documented. So each kind of frame has its own active port:

=========================== =======================================================================
a frame is received on      it is
=========================== =======================================================================
the active port, or is the  taken
first of its kind
the other port              dropped as a copy, unless none of its kind was taken for the timeout;
                            then it is taken, and its port becomes active
the other port, and is      taken, and its port becomes active
urgent
=========================== =======================================================================

So no frame is taken twice, and the link survives one dead port. Commands leave from the port that
receives the velocity: it is unsolicited, and the board is assumed to accept commands from the port
it sends to. A query leaves from the port that receives its answers; while there are none for half a
second, or for the timeout of a slow query, from the ports in turn.
"""

from collections.abc import Mapping

from msgspec import Struct

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from common.wire.reports import BumperReport, VelocityReport

UNANSWERED_NS = NS_PER_S // 2
PERIODS = 2.5  # without a frame of its kind, until the other port is taken


class Stream(Struct, frozen=True):
    """Active port of one kind of frame, and the last receive time."""

    port: int
    received_ns: int


class Ports:
    """The active port of each kind of frame; ports are counted from 0."""

    def __init__(
        self, count: int, failover_ns: int, rates_hz: Mapping[type[Frame], float], now_ns: int
    ) -> None:
        """Set up with the number of ports, and the poll rate of each kind of frame."""
        self.main = 0  # commands leave from here
        self._count = count
        self._failover_ns = failover_ns
        self._timeout_ns = {
            kind: max(failover_ns, round(PERIODS / rate_hz * NS_PER_S))
            for kind, rate_hz in rates_hz.items()
        }
        self._began_ns = now_ns
        self._streams: dict[type[Frame], Stream] = {}

    def takes(self, kind: type[Frame], port: int, now_ns: int, *, urgent: bool = False) -> bool:
        """Return whether a frame is taken; then its port is the active one of its kind."""
        stream = self._streams.get(kind)
        if stream is not None and stream.port != port and not urgent:
            timeout_ns = self._timeout_ns.get(kind, self._failover_ns)
            if now_ns - stream.received_ns <= timeout_ns:
                return False
        self._streams[kind] = Stream(port, now_ns)
        if kind is VelocityReport or VelocityReport not in self._streams:
            self.main = port
        return True

    def of(self, kind: type[Frame]) -> int | None:
        """Return the active port of a kind of frame; None before the first."""
        stream = self._streams.get(kind)
        return None if stream is None else stream.port

    def to_ask(self, answer: type[Frame], now_ns: int) -> int:
        """Return the port to send the query for this kind of answer from."""
        timeout_ns = self._timeout_ns.get(answer)
        if timeout_ns is None:  # asked rarely: the port that receives answers to polls
            polled = self.of(BumperReport)
            return self.main if polled is None else polled
        stream = self._streams.get(answer, Stream(self.main, self._began_ns))
        turn_ns = max(UNANSWERED_NS, timeout_ns)
        # 1 equivalent mutant: a nanosecond is no turn: both give the first port.
        return (stream.port + max(0, now_ns - stream.received_ns) // turn_ns) % self._count

    def is_received(self, kind: type[Frame], now_ns: int) -> bool:
        """Return whether this kind of frame was received within the last half second."""
        stream = self._streams.get(kind)
        return stream is not None and now_ns - stream.received_ns <= UNANSWERED_NS

    def by_name(self) -> dict[str, int]:
        """Return the active port of each kind of frame, by the kind's name."""
        return {kind.__name__: stream.port for kind, stream in self._streams.items()}
