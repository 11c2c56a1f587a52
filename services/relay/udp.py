"""A UDP socket that is connected to one peer: the kernel drops the datagrams of all others."""

import errno
import socket
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress

Address = tuple[str, int]

DATAGRAM_MAX = 2048  # as the bridge reads; the board's frames have 24 bytes at most
BURST = 16  # datagrams in a round, so that a flood delays no other socket and no timer
FLOOD_PAUSE_S = 20e-6  # a SCHED_FIFO process must leave time to the others
ATTEMPTS = 3  # an ICMP error of an earlier datagram makes the next send fail


class Endpoint:
    """A socket from an address of ours to one peer; it opens when its address exists."""

    def __init__(self, own: Address, peer: Address, counters: Counter[str], shared: bool) -> None:
        """Set up closed; ``shared``: another endpoint has the same own address."""
        self.empty_ns = 0  # when the queue was last empty: its datagrams arrived later
        self.problem = "not opened yet"
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._own, self._peer, self._counters, self._shared = own, peer, counters, shared

    def open(self) -> bool:
        """Bind and connect; return whether that succeeded, or set ``problem``.

        Raise ``OSError`` when another program has the port.
        """
        self.sock.close()
        self.sock = sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setblocking(False)
        try:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(self._shared))
            sock.bind(self._own)
            sock.connect(self._peer)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise
            self.problem = f"{self._own[0]}:{self._own[1]}: {error.strerror}"
            return False
        with suppress(OSError):
            while True:  # drop what anybody sent before the socket was connected
                sock.recv(1)
        self.problem, self.empty_ns = "", time.monotonic_ns()
        return True

    def read(self) -> Iterator[bytes]:
        """Yield the waiting datagrams, a burst at most; a full one ends with a short sleep."""
        for _ in range(0 if self.problem else BURST):
            before_ns = time.monotonic_ns()
            try:
                datagram = self.sock.recv(DATAGRAM_MAX + 1)
            except BlockingIOError:
                self.empty_ns = before_ns
                return
            except OSError:
                continue  # an ICMP error of an earlier datagram: the peer is absent
            if len(datagram) <= DATAGRAM_MAX:
                yield datagram
            else:
                self._counters["too_long"] += 1
        time.sleep(FLOOD_PAUSE_S)

    def send(self, datagram: bytes) -> None:
        """Send to the peer; a refusal of the system is repeated at once, then counted."""
        for _ in range(0 if self.problem else ATTEMPTS):
            with suppress(OSError):
                self.sock.send(datagram)
                return
        self._counters["send_errors"] += 1
