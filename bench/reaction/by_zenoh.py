"""``python -m bench.reaction.by_zenoh board PORT ENDPOINT | judge ENDPOINT``: Zenoh and a router.

What T2 stands on, without T2: sent at once, and heard in the thread that reads the link.
"""

import json
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from bench.reaction.pair import HIT, Gate
from common.bus.publisher import qos
from common.keys import ESTOP_CLASS, ClassOfService

FOR_EVER = -1  # who dials waits until the other one listens
ALONE = {"scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}}}


def opened(settings: Mapping[str, Any]) -> zenoh.Session:
    """Open a session that looks for nobody by itself."""
    return zenoh.open(zenoh.Config.from_json5(json.dumps({**ALONE, **settings})))


def joined(endpoint: str, settings: Mapping[str, Any] = {}) -> zenoh.Session:
    """Dial, and return the session."""
    connect = {"endpoints": [endpoint], "timeout_ms": FOR_EVER}
    return opened({"mode": "client", "connect": connect, **settings})


def publisher(
    session: zenoh.Session, key: str, service: ClassOfService = ESTOP_CLASS
) -> zenoh.Publisher:
    """Declare what sends; at once, unless its class may wait for more to send."""
    return session.declare_publisher(key, **qos(service))


def subscribe(session: zenoh.Session, key: str, take: Callable[[zenoh.Sample], object]) -> None:
    """Let a call take what comes, in the thread that reads the link."""
    session.declare_subscriber(key, zenoh.handlers.Callback(take, indirect=False))


def board(port: int, session: zenoh.Session) -> None:
    """Stand between the board and the judge until killed."""
    gate = Gate(port)
    subscribe(session, "verdicts", lambda _: gate.brake())
    hits = publisher(session, "hits")
    while True:
        if gate.take():
            hits.put(HIT)


def judge(session: zenoh.Session) -> None:
    """Decide until killed."""
    verdicts = publisher(session, "verdicts")
    subscribe(session, "hits", lambda _: verdicts.put(HIT))
    threading.Event().wait()


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, endpoint]:
            board(int(port), joined(endpoint))
        case ["judge", endpoint]:
            judge(joined(endpoint))
