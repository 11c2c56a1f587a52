"""Zenoh with a router, without T2; ``where`` is the router's endpoint.

Messages are sent at once (express) and received in the thread that reads the link.
"""

import json
import threading
from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from bench.adapters.protocols import HIT, BoardSocket, Twist, packed, unpacked
from common.bus.publisher import qos
from common.keys import ESTOP_CLASS, ClassOfService

WAIT_FOREVER = -1  # a client waits until the router listens
NO_SCOUTING = {"scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}}}
KEY = "twist"


def opened(settings: Mapping[str, Any]) -> zenoh.Session:
    """Open a session without scouting."""
    return zenoh.open(zenoh.Config.from_json5(json.dumps({**NO_SCOUTING, **settings})))


def connected(endpoint: str, settings: Mapping[str, Any] = {}) -> zenoh.Session:
    """Return a client session at an endpoint."""
    connect = {"endpoints": [endpoint], "timeout_ms": WAIT_FOREVER}
    return opened({"mode": "client", "connect": connect, **settings})


def publisher(
    session: zenoh.Session, key: str, service: ClassOfService = ESTOP_CLASS
) -> zenoh.Publisher:
    """Declare a publisher; express, unless its class of service allows batching."""
    return session.declare_publisher(key, **qos(service))


def declare(session: zenoh.Session, key: str, take: Callable[[zenoh.Sample], object]) -> None:
    """Declare a subscriber whose callback runs in the thread that reads the link."""
    session.declare_subscriber(key, zenoh.handlers.Callback(take, indirect=False))


def source(where: str) -> Twist:
    """Return a function that publishes a twist."""
    session = connected(where)
    out = publisher(session, KEY)

    def publish(linear: float, angular: float, _: zenoh.Session = session) -> None:
        out.put(packed(linear, angular))

    return publish


def subscribe(where: str, take: Twist) -> None:
    """Pass received twists on until killed."""
    session = connected(where)
    declare(session, KEY, lambda sample: take(*unpacked(sample.payload.to_bytes())))
    threading.Event().wait()


def board(sock: BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    board_on(connected(where), sock)


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    decide_on(connected(where))


def board_on(session: zenoh.Session, sock: BoardSocket) -> None:
    """Run the process at the board on a session."""
    declare(session, "verdicts", lambda _: sock.brake())
    hits = publisher(session, "hits")
    while True:
        if sock.receive_hit():
            hits.put(HIT)


def decide_on(session: zenoh.Session) -> None:
    """Run the process that decides on a session."""
    verdicts = publisher(session, "verdicts")
    declare(session, "hits", lambda _: verdicts.put(HIT))
    threading.Event().wait()
