"""Port selection: the UDP port that each kind of frame is taken from.

The board sends to both ports (manual 1), but the manual marks the velocity "S0, S1" and queries
"S1": which frame uses which port is not documented. So each kind of frame has its own active port:

================================= =================================================================
a frame is received               it is
================================= =================================================================
on the active port, or is the     taken
first of its kind
on the other port                 dropped as a copy, unless the active port is silent: no such frame
                                  for the timeout of its kind, or no frame at all for the failover
                                  time; then it is taken, and its port becomes active
on the other port, and is urgent  taken, and its port becomes active: a new bumper hit, a driver
                                  fault and an emergency brake that is off count from either port
================================= =================================================================

So no datagram is taken twice, and the link survives one dead port. Commands leave from the port
that receives the velocity: it is unsolicited, and the board is assumed to accept commands from the
port it sends to. A query leaves from the port that receives its answers; while there are none for
half a second, or for the timeout of a slow query, from the ports in turn.
"""

from collections.abc import Mapping

from msgspec import Struct

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from common.wire.reports import (
    BumperBrakeReport,
    BumperReport,
    DriverReport,
    UltrasonicBrakeReport,
    VelocityReport,
)

BRAKE_REPORTS = (UltrasonicBrakeReport, BumperBrakeReport)
URGENT_KINDS = frozenset((BumperReport, DriverReport, *BRAKE_REPORTS))
UNANSWERED_NS = NS_PER_S // 2
PERIODS = 2.5  # without a frame of its kind, until the other port is taken


class Stream(Struct):
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
        self._received_ns = [now_ns] * count
        self._streams: dict[type[Frame], Stream] = {}

    def takes(self, kind: type[Frame], port: int, now_ns: int) -> bool:
        """Record a frame on a port; return whether it is taken."""
        self._received_ns[port] = now_ns
        stream = self._streams.get(kind)
        if stream is None or stream.port == port:
            return True
        timeout_ns = self._timeout_ns.get(kind, self._failover_ns)
        return (
            now_ns - stream.received_ns > timeout_ns
            or now_ns - self._received_ns[stream.port] > self._failover_ns
        )

    def take(self, kind: type[Frame], port: int, now_ns: int) -> bool:
        """Make the port active for a frame's kind; return whether that changed."""
        if kind is VelocityReport or VelocityReport not in self._streams:
            self.main = port
        stream = self._streams.get(kind)
        if stream is None:
            self._streams[kind] = Stream(port, now_ns)
            return False
        changed = stream.port != port
        stream.port, stream.received_ns = port, now_ns
        return changed

    def to_ask(self, answer: type[Frame], now_ns: int) -> int:
        """Return the port to send the query for this kind of answer from."""
        timeout_ns = self._timeout_ns.get(answer)
        if timeout_ns is None:  # asked rarely: the port that receives answers to polls
            stream = self._streams.get(BumperReport)
            return self.main if stream is None else stream.port
        stream = self._streams.get(answer)
        port, since_ns = (
            (self.main, self._began_ns) if stream is None else (stream.port, stream.received_ns)
        )
        turn_ns = max(UNANSWERED_NS, timeout_ns)
        # 1 equivalent mutant: a nanosecond is no turn: both give the first port.
        return (port + max(0, now_ns - since_ns) // turn_ns) % self._count

    def is_received(self, kind: type[Frame], now_ns: int) -> bool:
        """Return whether this kind of frame was received within the last half second."""
        stream = self._streams.get(kind)
        return stream is not None and now_ns - stream.received_ns <= UNANSWERED_NS

    def by_name(self) -> dict[str, int]:
        """Return the active port of each kind of frame, by the kind's name."""
        return {kind.__name__: stream.port for kind, stream in self._streams.items()}
