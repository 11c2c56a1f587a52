"""Port selection: the UDP port that each kind of frame is taken from. Pure.

The board sends to both ports (manual 1), but the manual marks the velocity "S0, S1" and queries
"S1": which frame uses which port is not documented. So each kind of frame has its own active port:

=========================== =======================================================================
a frame is received on      it is
=========================== =======================================================================
the active port, or is the  taken
first of its kind
the other port              dropped as a copy, unless none of its kind was taken for the failover
                            time; then it is taken, and its port becomes active
the other port, and is      taken, and its port becomes active
urgent
=========================== =======================================================================

So no frame is taken twice, and the link survives one dead port. Commands leave from the port that
receives the velocity: it is unsolicited, and the board is assumed to accept commands from the port
it sends to. Queries leave from the port that receives their answers, by the bumper's, which is
polled most often; while there are none for half a second, from the ports in turn.
"""

from msgspec import Struct

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from common.wire.reports import BumperReport, VelocityReport

UNANSWERED_NS = NS_PER_S // 2


class Stream(Struct, frozen=True):
    """Active port of one kind of frame, and the last receive time."""

    port: int
    received_ns: int


class Ports:
    """The active port of each kind of frame; ports are counted from 0."""

    def __init__(self, count: int, failover_ns: int, now_ns: int) -> None:
        self.main = 0  # commands leave from here
        self.streams: dict[type[Frame], Stream] = {}
        self._count = count
        self._failover_ns = failover_ns
        self._began_ns = now_ns

    def takes(self, kind: type[Frame], port: int, now_ns: int, *, urgent: bool = False) -> bool:
        """Return whether a frame is taken; then its port is the active one of its kind."""
        stream = self.streams.get(kind)
        if stream is not None and stream.port != port and not urgent:
            silent_ns = now_ns - stream.received_ns
            if silent_ns <= self._failover_ns:
                return False
        self.streams[kind] = Stream(port, now_ns)
        if kind is VelocityReport:
            self.main = port
        return True

    def to_ask(self, now_ns: int) -> int:
        """Return the port to send a query or a setting from."""
        stream = self.streams.get(BumperReport, Stream(self.main, self._began_ns))
        return (stream.port + max(0, now_ns - stream.received_ns) // UNANSWERED_NS) % self._count
