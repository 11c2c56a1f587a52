"""The sockets to the board: both of our ports, and nobody but the board."""

import errno
import socket
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress

from common.errors import LinkError
from common.settings import Board
from services.bridge.rx_timestamp import ANCILLARY_MAX, SO_TIMESTAMPNS, Receipt, WallClock, stamp_in

DATAGRAM_MAX = 2048
# A flood must not keep the loop from its timers: the rest waits for the next round.
BURST = 64
BREATH_S = 20e-6
BRAKE_ATTEMPTS = 4  # at once, when the system refuses to send a BREAK

Ancillary = list[tuple[int, int, bytes]]


class Sockets:
    """One socket for each of our ports; commands leave from the one that is active."""

    def __init__(self, board: Board, inherited: Sequence[int] = ()) -> None:
        """Bind the ports, or take over the descriptors of a parent that has bound them.

        Raise ``LinkError`` naming the one that cannot be had.
        """
        self.refused = 0  # datagrams from anybody else
        self.send_errors = 0  # datagrams that the system refused to send
        self.last_error = ""  # of those, in words
        self.last_stranger: tuple[str, int] | None = None
        self._board = (board.address, board.port)
        self._any_port = board.any_source_port
        self.sockets = [socket.socket(fileno=descriptor) for descriptor in inherited] or [
            _bind(board.listen_address, port) for port in board.listen_ports
        ]
        self.wall = WallClock()
        for sock in self.sockets:
            want_stamps(sock)

    def read(self, port: int) -> Iterator[tuple[bytes, Ancillary, int]]:
        """Yield what the board sent to the port of this index: bytes, ancillary data, read time.

        A burst ends with a short sleep: in a flood Linux would take us for one that runs away, and
        end us (``realtime.limit``).
        """
        sock = self.sockets[port]
        for _ in range(BURST):
            try:
                datagram, ancillary, _, source = sock.recvmsg(DATAGRAM_MAX, ANCILLARY_MAX)
            except BlockingIOError:
                return
            except OSError:
                continue  # an earlier command found no board, or no network
            if source == self._board or (self._any_port and source[0] == self._board[0]):
                yield datagram, ancillary, time.monotonic_ns()
            else:
                self.refused += 1
                self.last_stranger = source
        time.sleep(BREATH_S)

    def receipt(self, ancillary: Ancillary, read_ns: int) -> Receipt:
        """Return when a datagram came that was read with these ancillary data."""
        before_ns, wall_ns, now_ns = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        self.wall.look(before_ns, wall_ns, now_ns)
        stamp_ns = stamp_in(ancillary)
        kernel_ns = None if stamp_ns is None else self.wall.monotonic_ns(stamp_ns, read_ns)
        return Receipt(kernel_ns, read_ns)

    def send(self, datagram: bytes, port: int, attempts: int = 1) -> bool:
        """Send to the board from the port of this index; return whether the system took it.

        A refusal (no network, no buffer, no permission) is counted, and the call is repeated at
        once, ``attempts`` times in total.
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
        """Give the ports back."""
        for sock in self.sockets:
            sock.close()


def want_stamps(sock: socket.socket) -> None:
    """Have the kernel stamp what it receives; a system that does not is done without."""
    if sys.platform == "linux":  # elsewhere the number means something else
        with suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)


def _bind(address: str, port: int) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    try:
        sock.bind((address, port))
    except OSError as error:
        sock.close()
        hint = {
            errno.EADDRINUSE: "another program has it; is a bridge running already?",
            errno.EADDRNOTAVAIL: "this host has no such address; see board.listen_address",
        }.get(error.errno or 0, error.strerror)
        raise LinkError(f"cannot listen on UDP {address}:{port}: {hint}") from None
    return sock
