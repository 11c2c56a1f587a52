"""What all pairs have in common: one process at the board, and one that decides.

The first one reads the board's datagrams, hands a hit over, and says BREAK when the second one
answers; it says STOP to everything else by itself. The second one answers every hit that it hears.
"""

import socket

from bench.reaction.loop import BREAK, STOP, command, is_hit

HIT = b"\1"  # what goes from one to the other, and back


class Gate:
    """The socket to the board."""

    def __init__(self, port: int) -> None:
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(("127.0.0.1", port))
        self._stop, self._brake = command(STOP), command(BREAK)
        self._board = ("127.0.0.1", port)

    def take(self) -> bool:
        """Wait for a datagram; tell whether it is a hit, and say STOP if it is none."""
        datagram, self._board = self.sock.recvfrom(2048)
        if is_hit(datagram):
            return True
        self.sock.sendto(self._stop, self._board)
        return False

    def brake(self) -> None:
        """Say BREAK, from any thread."""
        self.sock.sendto(self._brake, self._board)
