"""Stand-in for the bridge's sockets."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from common.wire.framing import Framing, Received
from common.wire.reports import FROM_BOARD
from services.bridge.rx_timestamp import Receipt, WallClock
from services.bridge.udp import Ancillary
from verification.invariants.process import Process

if TYPE_CHECKING:
    from verification.invariants.stack import Chain


class Sockets:
    """The bridge's end of the cable."""

    refused = send_errors = 0
    last_foreign_source = None

    def __init__(self, stack: "Chain[Any]", process: Process) -> None:
        self.sockets = [object() for _ in process.config.board.listen_ports]
        self.wall = WallClock()
        self._stack = stack
        self._process = process
        self._framing = Framing()

    def read(self, first: int, *ports: int) -> Iterator[tuple[int, bytes, Ancillary, int]]:
        """Yield what waits at these ports, after the oracle has seen it."""
        for port in sorted(ports, key=lambda port: port != first):
            inbox = self._stack.vehicle.inboxes[port]
            while inbox:
                datagram = inbox.popleft()
                parts = self._framing.read(datagram, FROM_BOARD)
                frames = [part.frame for part in parts if isinstance(part, Received)]
                self._stack.oracle.on_report(self._process, frames, port)
                yield port, datagram, [], self._stack.net.now_ns

    def receipt(self, _: Ancillary, read_ns: int) -> Receipt:
        """Return when a datagram was read; nobody has stamped it."""
        return Receipt(None, read_ns)

    def take_relay_report(self) -> bytes:
        """Return nothing: there is no relay."""
        return b""

    def send(self, datagram: bytes, port: int, attempts: int = 1) -> bool:
        """Send to the board, with the oracle's complaints."""
        complaints = self._stack.oracle.on_leaving(self._process, datagram)
        self._stack.vehicle.receive(datagram, port, complaints)
        return True
