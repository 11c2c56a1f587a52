"""No bus: a datagram on loopback; ``where`` is the subscriber's port."""

import socket

from bench.adapters.protocols import Twist, packed, unpacked


def source(where: str) -> Twist:
    """Return a function that publishes a twist."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    there = ("127.0.0.1", int(where))
    return lambda *twist: sock.sendto(packed(*twist), there)


def subscribe(where: str, take: Twist) -> None:
    """Pass received twists on until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(where)))
    while True:
        take(*unpacked(sock.recv(2048)))
