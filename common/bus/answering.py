"""Whether a router works: it takes a new session and answers a question about itself."""

import contextlib

import zenoh
from msgspec.structs import replace

from common.bus.session import client_config
from common.settings import BusSettings


def router_at(where: BusSettings) -> BusSettings:
    """Return the settings of a client of the router that listens there, and of no other."""
    return replace(where, connect=replace(where, connect=()).endpoints[:1])


def answers(where: BusSettings) -> bool:
    """Open a session, ask the router at its other end one question, and close the session.

    A router that hangs may keep the caller for long: call it in a thread of its own.
    """
    with contextlib.suppress(zenoh.ZError), zenoh.open(client_config(where)) as session:
        # A robot's router that dials a site's is a peer.
        routers = (*session.info.routers_zid(), *session.info.peers_zid())
        return any(
            reply.ok
            for zid in routers
            for reply in session.get(f"@/{zid}/*", timeout=where.probe_deadline)
        )
    return False
