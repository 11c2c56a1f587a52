"""``python -m bench.zenoh_programs``: programs without T2, with plain Zenoh and MessagePack.

- ``board``, ``decide``: the two processes of ``loop.run_pair``; each message is sent at once.
- ``drive-board PORT ENDPOINT BOARD``, ``drive-decide ENDPOINT``: the process at the board sends the
  bridge's queries at their rates, and publishes the values of each frame. The other one stores the
  newest and publishes a motion 50 times a second, which the first one turns into a frame.
- ``consume ENDPOINT KEY ...``: a consumer, as a child process.
"""

import json
import select
import struct
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import msgpack
import zenoh

from bench.child_process import serve
from bench.loop import BUMPER, MOTION, RUN, BoardSocket, Call, command, content, framed, run_pair
from common import clock
from common.bus.publisher import qos
from t2.keys import COMMAND, ESTOP_CLASS, FAST

WAIT_FOREVER = -1  # a client waits until the router listens
DIRECT = "unixsock-stream/"
HIT = b"\1"  # payload of a hit and of its answer
MOTION_S, SPEED_MMPS = 0.02, 300
AGES_MAX = 1000  # reported by a consumer, evenly spread
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


def connected(endpoint: str, *, listens: bool | None = None) -> zenoh.Session:
    """Return a client of a router, without scouting; with ``listens`` an end of a direct link."""
    settings: dict[str, Any] = {
        "mode": "client" if listens is None else "peer",
        "listen": {"endpoints": [endpoint] if listens else []},
        "connect": {"endpoints": [] if listens else [endpoint], "timeout_ms": WAIT_FOREVER},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


def declare(session: zenoh.Session, key: str, take: Callable[[zenoh.Sample], object]) -> None:
    """Declare a subscriber whose callback runs in the thread that reads the link."""
    session.declare_subscriber(key, zenoh.handlers.Callback(take, indirect=False))


def join(where: str, writes: str, reads: str, take: Call | None) -> Call:
    """Join by a router, or directly by a Unix socket: the process at the board listens."""
    session = connected(where, listens=bool(take) if where.startswith(DIRECT) else None)
    out = session.declare_publisher(writes, **qos(ESTOP_CLASS))

    def send(_: zenoh.Session = session) -> None:  # it lives as long as this function
        out.put(HIT)

    then = take or send
    declare(session, reads, lambda _: then())
    return send


def drive_board(port: str, where: str, board_port: str) -> None:
    """Query the board, publish its frames and send the received motions, until killed."""
    session, sock = connected(where), BoardSocket(int(port)).sock
    to = ("127.0.0.1", int(board_port))
    reports = session.declare_publisher("reports", **qos(FAST))

    def send(sample: zenoh.Sample) -> None:
        motion = msgpack.unpackb(sample.payload.to_bytes())
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

    def take(sample: zenoh.Sample) -> None:
        message = msgpack.unpackb(sample.payload.to_bytes())
        newest[message["kind"]] = message["values"]

    motions = session.declare_publisher("motions", **qos(COMMAND))
    declare(session, "reports", take)
    due_s = time.monotonic()
    while True:
        motions.put(MOTION_MESSAGE)
        due_s = max(due_s + MOTION_S, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


class Consumer:
    """Counts from ``begin`` on."""

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}
        self.begin()

    def begin(self) -> None:
        """Reset the counts."""
        self._bytes = self._lost = 0
        self._ages_ns: list[int] = []
        self._since_s = time.monotonic()

    def take(self, sample: zenoh.Sample) -> None:
        """Count one message, payload and attachment."""
        payload, key = sample.payload.to_bytes(), str(sample.key_expr)
        message: dict[str, Any] = msgpack.unpackb(payload)
        self._ages_ns.append(clock.now_ns() - message["mono_ns"])
        self._bytes += len(payload) + (len(sample.attachment) if sample.attachment else 0)
        before = self._newest.get(key, message["seq"] - 1)
        self._lost += max(0, message["seq"] - before - 1)
        self._newest[key] = message["seq"]

    def end(self) -> object:
        """Return the counts, per second, and the ages."""
        past_s = time.monotonic() - self._since_s
        count = len(self._ages_ns)
        return {
            "hz": count / past_s,
            "bytes_per_s": self._bytes / past_s,
            "lost": self._lost / max(1, count + self._lost),
            "ages_ns": self._ages_ns[:: max(1, count // AGES_MAX)],
        }


def consume(endpoint: str, *keys: str) -> None:
    """Consume until standard input ends."""
    consumer, left = Consumer(), threading.Event()
    with connected(endpoint) as session:
        declared = [session.declare_subscriber(key, consumer.take) for key in keys]
        serve(consumer.begin, consumer.end, left.set)
        left.wait()
        for each in declared:
            each.undeclare()


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["drive-board", *given]:
            drive_board(*given)
        case ["drive-decide", endpoint]:
            drive_decide(endpoint)
        case ["consume", *given]:
            consume(*given)
        case _:
            run_pair(join)
