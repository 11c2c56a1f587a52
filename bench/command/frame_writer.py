"""``python -m bench.command.frame_writer PORT BOARD NAME WHERE``: turn requests into frames.

Makes no safety decision.
"""

import socket
import sys

from bench.adapters.protocols import path_adapter
from bench.reaction.loop import RUN, command


def main(port: str, board: str, name: str, where: str) -> None:
    """Send frames to the board until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    there = ("127.0.0.1", int(board))

    def drive(linear: float, _: float) -> None:
        sock.sendto(command(RUN, round(1000 * linear)), there)

    path_adapter(name).subscribe(where, drive)


if __name__ == "__main__":
    main(*sys.argv[1:])
