"""``python -m bench.command.source PORT t2 SETTING ... | PORT by NAME WHERE``: a motion source.

A byte that arrives at PORT selects the speed to request. The answer is the time just before the
request.
"""

import socket
import sys
from collections.abc import Sequence

from bench.adapters.protocols import Twist, path_adapter, stamped
from bench.path.vehicle import SPEEDS_MMPS
from common import clock, keys
from common.bus.bus import Arrival, Bus
from common.config import Sources, load
from common.loop import Loop
from common.messages import SafetyState
from common.operator import reset_request
from common.settings import Shared
from common.source import DriveSource


def serve(sock: socket.socket, request: Twist) -> None:
    """Send one request for the next datagram."""
    datagram, vehicle = sock.recvfrom(16)
    requested_ns = clock.now_ns()
    request(SPEEDS_MMPS[datagram[0]] / 1000, 0.0)
    sock.sendto(stamped(datagram[0], requested_ns), vehicle)


def by_t2(sock: socket.socket, sets: Sequence[str]) -> None:
    """Send requests as teleop does; reset latches that a busy host caused."""
    config = load(Shared, Sources(sets=sets)).config
    loop = Loop()
    bus = Bus(config.bus, config.robot.id, loop.post)
    source = DriveSource(bus, "teleop")

    def reset(arrival: Arrival[SafetyState]) -> None:
        if arrival.message.latched:
            bus.call(keys.RESET, reset_request(arrival.message), lambda _: None, lambda _: None)

    bus.subscribe(keys.SAFETY, reset)
    loop.watch(sock, lambda _: serve(sock, source.request))
    bus.open()
    loop.run()


def main(port: str, *words: str) -> None:
    """Serve until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    match words:
        case ["t2", *sets]:
            by_t2(sock, sets)
        case ["by", name, where]:
            request = path_adapter(name).source(where)
            while True:
                serve(sock, request)


if __name__ == "__main__":
    main(*sys.argv[1:])
