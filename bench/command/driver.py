"""``python -m bench.command.driver PORT BOARD NAME WHERE``: what is asked for becomes a frame.

Nothing is judged.
"""

import socket
import sys

from bench.path.bus import carrier
from bench.reaction.loop import RUN, command


def main(port: str, board: str, name: str, where: str) -> None:
    """Drive until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    there = ("127.0.0.1", int(board))

    def drive(linear: float, _: float) -> None:
        sock.sendto(command(RUN, round(1000 * linear)), there)

    carrier(name).listen(where, drive)


if __name__ == "__main__":
    main(*sys.argv[1:])
