"""``python -m bench.start.script PORT BOARD``: bind a port and send STOP.

A script without settings, checks and guard.
"""

import socket
import sys

from bench.reaction.loop import STOP, command


def main() -> None:
    """Send STOP once, then wait."""
    port, board = map(int, sys.argv[1:])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", port))
        sock.sendto(command(STOP), ("127.0.0.1", board))
        sock.recv(2048)


if __name__ == "__main__":
    main()
