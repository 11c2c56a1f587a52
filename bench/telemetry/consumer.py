"""``python -m bench.telemetry.consumer WITNESS ...``: consume decoded velocities.

``frames PORT`` reads the board's frames, ``by NAME WHERE`` uses another bus, ``t2 CONFIG`` uses
Zenoh and MessagePack alone. It sends a stamp of each velocity to the witness's port.
"""

import socket
import sys
import threading

import msgpack
import zenoh

from bench.adapters.protocols import Twist, path_adapter, stamped
from bench.reaction.loop import velocity
from common import clock, keys


def by_frames(port: str, take: Twist) -> None:
    """Read the frames that the board sends to a port."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(port)))
    while True:
        measured = velocity(sock.recv(2048))
        if measured:
            take(*measured)


def by_t2(config: str, take: Twist) -> None:
    """Subscribe to the bridge's velocity."""

    def decode(sample: zenoh.Sample) -> None:
        message = msgpack.unpackb(sample.payload.to_bytes())
        take(message["linear"], message["angular"])

    with zenoh.open(zenoh.Config.from_json5(config)) as session:
        declared = session.declare_subscriber(keys.VELOCITY.on("001"), decode)
        threading.Event().wait()
        del declared


def main(witness: str, *words: str) -> None:
    """Consume until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    there = ("127.0.0.1", int(witness))

    def take(linear: float, _: float) -> None:
        at_ns = clock.now_ns()
        sock.sendto(stamped(round(1000 * linear), at_ns), there)

    match words:
        case ["frames", port]:
            by_frames(port, take)
        case ["t2", config]:
            by_t2(config, take)
        case ["by", name, where]:
            path_adapter(name).subscribe(where, take)


if __name__ == "__main__":
    main(*sys.argv[1:])
