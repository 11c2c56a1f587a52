"""``python -m bench.telemetry.forwarder PORT NAME WHERE``: forward velocities to another bus."""

import socket
import sys

from bench.adapters.protocols import path_adapter
from bench.reaction.loop import velocity


def main(port: str, name: str, where: str) -> None:
    """Forward until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    publish = path_adapter(name).source(where)
    while True:
        measured = velocity(sock.recv(2048))
        if measured:
            publish(*measured)


if __name__ == "__main__":
    main(*sys.argv[1:])
