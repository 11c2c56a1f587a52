"""Zenoh and a router, set as for ``bench.reaction``; ``where`` is the router's endpoint."""

import threading

import zenoh

from bench.path.twist import Say, packed, unpacked
from bench.reaction.by_zenoh import joined, publisher, subscribe

KEY = "twist"


def sender(where: str) -> Say:
    """Return what sends."""
    session = joined(where)
    out = publisher(session, KEY)

    def say(linear: float, angular: float, _: zenoh.Session = session) -> None:
        out.put(packed(linear, angular))

    return say


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""
    session = joined(where)
    subscribe(session, KEY, lambda sample: take(*unpacked(sample.payload.to_bytes())))
    threading.Event().wait()
