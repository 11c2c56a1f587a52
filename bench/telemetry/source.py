"""``python -m bench.telemetry.source PORT NAME WHERE``: the board's velocities to another bus."""

import socket
import sys

from bench.path.bus import carrier
from bench.reaction.loop import velocity


def main(port: str, name: str, where: str) -> None:
    """Pass on until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    say = carrier(name).sender(where)
    while True:
        measured = velocity(sock.recv(2048))
        if measured:
            say(*measured)


if __name__ == "__main__":
    main(*sys.argv[1:])
