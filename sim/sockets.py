"""The simulator's UDP sockets: the board's, and the control socket.

On the control socket, one JSON request in a datagram gets one JSON reply in another. It is for
tests and demonstrations on this host, and off unless ``sim.control_port`` is set. Requests are
those of ``sim.requests``: ``{"do": "bumper", "pressed": true}``.
"""

import contextlib
import socket
from collections.abc import Iterator

import msgspec

from common.settings import Board
from sim.faults import Datagram
from sim.requests import Asked
from sim.simulation import Reply, Simulation
from t2.errors import LinkError

HOST = "127.0.0.1"  # of the control socket
LARGEST = 65536
BURST = 256  # datagrams per round, so that a flood does not stall the simulation

_requests = msgspec.json.Decoder(Asked)


class BoardSocket:
    """The board's socket."""

    def __init__(self, board: Board) -> None:
        self._ports = board.listen_ports
        self._pc = board.listen_address
        self.sock = bound(board.address, board.port, "board.port")
        self.unsent = 0

    def receive(self) -> Iterator[tuple[bytes, int]]:
        """Yield received datagrams with the PC's port; those of other senders are ignored."""
        for payload, (address, port, *_) in drain(self.sock):
            if address == self._pc and port in self._ports:
                yield payload, port

    def send(self, datagram: Datagram) -> None:
        """Send to a port of the PC; count errors."""
        try:
            self.sock.sendto(datagram.payload, (self._pc, datagram.port))
        except OSError:
            self.unsent += 1


def answer_requests(control: socket.socket, simulation: Simulation, now_ns: int) -> None:
    """Answer the requests that wait at the control socket."""
    for payload, sender in drain(control):
        try:
            reply = simulation.handle(_requests.decode(payload), now_ns)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            reply = Reply(ok=False, error=str(error))
        with contextlib.suppress(OSError):  # the client may be gone
            control.sendto(msgspec.json.encode(reply), sender)


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


def drain(sock: socket.socket) -> Iterator[tuple[bytes, tuple[str, int]]]:
    """Yield waiting datagrams, a burst at most."""
    # ConnectionRefusedError belongs to an earlier datagram; the rest is read next time.
    with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
        for _ in range(BURST):
            payload, address = sock.recvfrom(LARGEST)
            yield payload, address
