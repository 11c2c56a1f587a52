"""UDP sockets to the board, one for each of our ports; other senders are dropped."""

import errno
import socket
import time
from collections.abc import Iterator, Sequence

from common import clock
from common.freshness import NS_PER_S
from common.settings import Board
from t2.errors import LinkError

DATAGRAM_MAX = 2048
# Limits of a round for each port, so that a flood does not delay the loop's timers: datagrams, and
# the time that they take. Both ports together take half a period of the heartbeat.
BURST = 64
BURST_NS = NS_PER_S // 200
BURST_PAUSE_S = 20e-6
BRAKE_ATTEMPTS = 4  # attempts when the system refuses to send a BRAKE


class Sockets:
    """One socket for each of our ports."""

    def __init__(self, board: Board, inherited: Sequence[int] = ()) -> None:
        """Bind the ports, or use inherited descriptors.

        Raise ``LinkError`` naming the port that cannot be bound.
        """
        self.refused = 0  # datagrams from other senders
        self.send_errors = 0  # datagrams that the system refused to send
        self.last_error = ""  # text of the last send error
        self.last_foreign_source: tuple[str, int] | None = None
        self._board = (board.address, board.port)
        self._any_port = board.any_source_port
        self._relay = (board.address, board.relay_port)  # no datagram comes from port 0
        self._relay_report = b""  # the newest, not taken yet
        self.sockets = [socket.socket(fileno=descriptor) for descriptor in inherited] or [
            _bind(board.listen_address, port) for port in board.listen_ports
        ]

    def read(self, *ports: int) -> Iterator[tuple[int, bytes, int]]:
        """Yield the board's datagrams: port, bytes, read time.

        ``ports`` are indices, in the order of reading. A full burst ends with a short sleep:
        without it, Linux kills a SCHED_FIFO process in a flood (``realtime.limit``).
        """
        for port in dict.fromkeys(ports):
            yield from self._burst(port)

    def _burst(self, port: int) -> Iterator[tuple[int, bytes, int]]:
        sock, end_ns = self.sockets[port], clock.now_ns() + BURST_NS
        for _ in range(BURST):
            try:
                datagram, source = sock.recvfrom(DATAGRAM_MAX)
            except BlockingIOError:
                return
            except OSError:
                continue  # ICMP error of an earlier send: no board, or no network
            read_ns = clock.now_ns()
            if source == self._relay:
                self._relay_report = datagram
            elif source == self._board or (self._any_port and source[0] == self._board[0]):
                yield port, datagram, read_ns
            else:
                self.refused += 1
                self.last_foreign_source = source
            if clock.now_ns() > end_ns:
                break
        time.sleep(BURST_PAUSE_S)

    def take_relay_report(self) -> bytes:
        """Return the newest report of a relay once; or empty."""
        report, self._relay_report = self._relay_report, b""
        return report

    def send(self, datagram: bytes, port: int, attempts: int = 1) -> bool:
        """Send to the board from the port of this index; return whether that succeeded.

        An error (no network, no buffer, no permission) is counted; the call is repeated at once,
        ``attempts`` times in total.
        """
        for _ in range(attempts):
            try:
                self.sockets[port].sendto(datagram, self._board)
            except OSError as error:
                self.send_errors += 1
                self.last_error = error.strerror or str(error)
            else:
                return True
        return False

    def close(self) -> None:
        """Close the sockets."""
        for sock in self.sockets:
            sock.close()


def _bind(address: str, port: int) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    try:
        sock.bind((address, port))
    except OSError as error:
        sock.close()
        hint = {
            errno.EADDRINUSE: "another program has it; is a bridge running already?",
            errno.EADDRNOTAVAIL: "this host has no such address (ip -brief address)",
        }.get(error.errno or 0, error.strerror)
        raise LinkError(f"cannot listen on UDP {address}:{port}: {hint}") from None
    return sock
