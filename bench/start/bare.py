"""``python -m bench.start.bare PORT BOARD``: bind a port, say STOP, and nothing else.

What somebody writes in an hour: no settings, no checks, nobody who guards it.
"""

import socket
import sys

from bench.reaction.loop import STOP, command


def main() -> None:
    """Say STOP once and stay."""
    port, board = map(int, sys.argv[1:])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", port))
        sock.sendto(command(STOP), ("127.0.0.1", board))
        sock.recv(2048)


if __name__ == "__main__":
    main()
