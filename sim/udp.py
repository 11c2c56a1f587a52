"""The sockets of the simulated board."""

import contextlib
import socket
from collections.abc import Iterator

from common.errors import LinkError
from common.settings import Board
from sim.faults import Datagram

LARGEST = 65536
BURST = 256  # datagrams per round, so that a flood does not stall the simulation

Address = tuple[str, int]


class BoardSocket:
    """The board's socket, and a second one that plays a foreign sender."""

    def __init__(self, board: Board) -> None:
        self._ports = board.listen_ports
        self._pc = board.listen_address
        self.sock = bound(board.address, board.port, "board.port")
        self._foreign = _foreign_socket(board.address)
        self.unsent = 0

    def receive(self) -> Iterator[tuple[bytes, int | None]]:
        """Yield received datagrams with the PC's port, or None for other senders."""
        for payload, (address, port, *_) in drain(self.sock):
            ours = address == self._pc and port in self._ports
            yield payload, port if ours else None

    def send(self, datagram: Datagram) -> None:
        """Send to a port of the PC; count errors."""
        sock = self._foreign if datagram.foreign else self.sock
        try:
            sock.sendto(datagram.payload, (self._pc, datagram.port))
        except OSError:
            self.unsent += 1

    def close(self) -> None:
        """Close the sockets."""
        self.sock.close()
        self._foreign.close()


def bound(address: str, port: int, setting: str) -> socket.socket:
    """Return a bound, non-blocking UDP socket; raise ``LinkError`` on failure."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.bind((address, port))
    except OSError as error:
        sock.close()
        raise LinkError(
            f"{setting}: cannot listen on UDP port {port} of {address}: {error.strerror}; "
            f"is another simulator running? --set {setting}=PORT takes another port"
        ) from None
    sock.setblocking(False)
    return sock


def drain(sock: socket.socket) -> Iterator[tuple[bytes, Address]]:
    """Yield waiting datagrams, a burst at most."""
    # ConnectionRefusedError belongs to an earlier datagram; the rest is read next time.
    with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
        for _ in range(BURST):
            payload, address = sock.recvfrom(LARGEST)
            yield payload, address


def _foreign_socket(address: str) -> socket.socket:
    """Return a socket with another loopback address, or another port on other networks."""
    if address.startswith("127."):
        other = "127.0.0.2" if address != "127.0.0.2" else "127.0.0.3"
        with contextlib.suppress(LinkError):  # not every system has the whole of 127.0.0.0/8
            return bound(other, 0, "board.address")
    return bound(address, 0, "board.address")
