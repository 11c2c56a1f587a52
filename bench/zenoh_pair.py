"""``python -m bench.zenoh_pair``: two processes without T2 on Zenoh with a router.

The address is the router's endpoint. Messages are received in the thread that reads the link.

- The two of ``loop.run_pair``: each message is sent at once (express).
- ``drive-board PORT ENDPOINT BOARD | drive-decide ENDPOINT``: the process at the board sends the
  bridge's queries at their rates, and publishes the values of each frame as MessagePack. The other
  one stores the newest and publishes a motion 50 times a second, which the first one turns into a
  frame.
"""

import json
import select
import struct
import sys
import time
from collections.abc import Callable
from typing import Any

import msgpack
import zenoh

from bench.loop import BUMPER, MOTION, RUN, BoardSocket, Call, command, content, framed, run_pair
from common import clock
from common.bus.publisher import qos
from common.keys import COMMAND, ESTOP_CLASS, FAST, ClassOfService

WAIT_FOREVER = -1  # a client waits until the router listens
HIT = b"\1"  # payload of a hit and of its answer
MOTION_S, SPEED_MMPS = 0.02, 300
MOTION_MESSAGE = msgpack.packb({"kind": RUN, "linear": SPEED_MMPS, "angular": 0})
MILEAGE, ULTRASONIC, DRIVER = 0x7600, 0x7601, 0x7605
LAYOUTS = {
    BUMPER: struct.Struct("<B"),
    MOTION: struct.Struct("<HH"),
    MILEAGE: struct.Struct("<ii"),
    ULTRASONIC: struct.Struct("<8H"),
    DRIVER: struct.Struct("<BI"),
}
QUERIES_HZ = {
    framed(BUMPER): 50.0,
    framed(MILEAGE): 25.0,
    framed(ULTRASONIC): 20.0,
    framed(DRIVER, b"\0"): 2.0,
    framed(DRIVER, b"\1"): 2.0,
}


def connected(endpoint: str) -> zenoh.Session:
    """Return a client session at an endpoint, without scouting."""
    settings: dict[str, Any] = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": WAIT_FOREVER},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


def publisher(
    session: zenoh.Session, key: str, service: ClassOfService = ESTOP_CLASS
) -> zenoh.Publisher:
    """Declare a publisher; express, unless its class of service allows batching."""
    return session.declare_publisher(key, **qos(service))


def declare(session: zenoh.Session, key: str, take: Callable[[bytes], object]) -> None:
    """Declare a subscriber whose callback runs in the thread that reads the link."""

    def unpacked(sample: zenoh.Sample) -> None:
        take(sample.payload.to_bytes())

    session.declare_subscriber(key, zenoh.handlers.Callback(unpacked, indirect=False))


def join(where: str, writes: str, reads: str, take: Call | None) -> Call:
    """Join by a router."""
    session = connected(where)
    out = publisher(session, writes)

    def send(_: zenoh.Session = session) -> None:  # it lives as long as this function
        out.put(HIT)

    then = take or send
    declare(session, reads, lambda _: then())
    return send


def drive_board(port: str, where: str, board_port: str) -> None:
    """Query the board, publish its frames and send the received motions, until killed."""
    session, sock = connected(where), BoardSocket(int(port)).sock
    to = ("127.0.0.1", int(board_port))
    reports = publisher(session, "reports", FAST)

    def send(raw: bytes) -> None:
        motion = msgpack.unpackb(raw)
        sock.sendto(command(motion["kind"], motion["linear"]), to)

    declare(session, "motions", send)
    due_s = dict.fromkeys(QUERIES_HZ, time.monotonic())
    while True:
        wait_s = max(0.0, min(due_s.values()) - time.monotonic())
        if select.select([sock], [], [], wait_s)[0] and (found := content(sock.recv(2048))):
            command_id, payload = found
            values = LAYOUTS[command_id].unpack(payload)
            message = {"kind": command_id, "values": values, "mono_ns": clock.now_ns()}
            reports.put(msgpack.packb(message))
        now_s = time.monotonic()
        for query in [one for one, at_s in due_s.items() if at_s <= now_s]:
            sock.sendto(query, to)
            due_s[query] += 1 / QUERIES_HZ[query]


def drive_decide(where: str) -> None:
    """Store the newest of each kind and publish a motion periodically, until killed."""
    session, newest = connected(where), dict[int, Any]()

    def take(raw: bytes) -> None:
        message = msgpack.unpackb(raw)
        newest[message["kind"]] = message["values"]

    motions = publisher(session, "motions", COMMAND)
    declare(session, "reports", take)
    due_s = time.monotonic()
    while True:
        motions.put(MOTION_MESSAGE)
        due_s = max(due_s + MOTION_S, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["drive-board", *given]:
            drive_board(*given)
        case ["drive-decide", endpoint]:
            drive_decide(endpoint)
        case _:
            run_pair(join)
