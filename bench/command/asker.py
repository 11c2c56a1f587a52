"""``python -m bench.command.asker PORT t2 SETTING ... | PORT by NAME WHERE``: who wants to move.

A byte that comes to PORT says which of the speeds to ask for; the answer to it is the moment just
before that was asked.
"""

import socket
import sys
import time
from collections.abc import Sequence

from bench.path.bus import carrier
from bench.path.stamp import stamped
from bench.path.twist import Say
from bench.path.vehicle import SPEEDS_MMPS
from common import keys
from common.bus.bus import Arrival, Bus
from common.config import Sources, load
from common.loop import Loop
from common.messages import SafetyState
from common.operator import reset_request
from common.settings import Shared
from common.source import DriveSource


def ask(sock: socket.socket, say: Say) -> None:
    """Ask for what the next datagram says."""
    datagram, vehicle = sock.recvfrom(16)
    asked_ns = time.monotonic_ns()
    say(SPEEDS_MMPS[datagram[0]] / 1000, 0.0)
    sock.sendto(stamped(datagram[0], asked_ns), vehicle)


def by_t2(sock: socket.socket, sets: Sequence[str]) -> None:
    """Ask as teleop does, and reset what a busy machine made safety latch."""
    config = load(Shared, Sources(sets=sets)).config
    loop = Loop()
    bus = Bus(config.bus, config.robot.id, loop.post)
    source = DriveSource(bus, "teleop")

    def reset(arrival: Arrival[SafetyState]) -> None:
        if arrival.message.latched:
            bus.ask(keys.RESET, reset_request(arrival.message), lambda _: None, lambda _: None)

    bus.subscribe(keys.SAFETY, reset)
    loop.watch(sock, lambda _: ask(sock, source.ask))
    bus.open()
    loop.run()


def main(port: str, *words: str) -> None:
    """Ask until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    match words:
        case ["t2", *sets]:
            by_t2(sock, sets)
        case ["by", name, where]:
            say = carrier(name).sender(where)
            while True:
                ask(sock, say)


if __name__ == "__main__":
    main(*sys.argv[1:])
