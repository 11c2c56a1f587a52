"""LCM, multicast on loopback; ``where`` is a multicast URL."""

import select
from typing import Any

import lcm

from bench.adapters.protocols import HIT, BoardSocket, Twist, packed, unpacked


def source(where: str) -> Twist:
    """Return a function that publishes a twist."""
    bus = lcm.LCM(where)
    return lambda *twist: bus.publish("twist", packed(*twist))


def subscribe(where: str, take: Twist) -> None:
    """Pass received twists on until killed."""
    bus = lcm.LCM(where)
    bus.subscribe("twist", lambda _, raw: take(*unpacked(raw)))
    while True:
        bus.handle()


def board(sock: BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    bus = lcm.LCM(where)
    bus.subscribe("verdicts", lambda *_: sock.brake())
    ends: list[Any] = [sock.sock, bus]
    while True:
        for ready in select.select(ends, [], [])[0]:
            if ready is bus:
                bus.handle()
            elif sock.receive_hit():
                bus.publish("hits", HIT)


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    bus = lcm.LCM(where)
    bus.subscribe("hits", lambda *_: bus.publish("verdicts", HIT))
    while True:
        bus.handle()
