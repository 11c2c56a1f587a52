"""Nothing in between: a datagram on loopback; ``where`` is the listener's port."""

import socket

from bench.path.twist import Say, packed, unpacked


def sender(where: str) -> Say:
    """Return what sends."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    there = ("127.0.0.1", int(where))
    return lambda *twist: sock.sendto(packed(*twist), there)


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(where)))
    while True:
        take(*unpacked(sock.recv(2048)))
