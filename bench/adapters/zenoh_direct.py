"""Zenoh without a router: the process at the board listens, the other one connects.

Each writes to the link in the thread that publishes (``lowlatency``), the fastest mode of Zenoh. A
publisher then blocks while the link is full.
"""

from bench.adapters import zenoh
from bench.adapters.protocols import BoardSocket

LOW_LATENCY = {"transport": {"unicast": {"lowlatency": True, "qos": {"enabled": False}}}}


def board(sock: BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    listen = {"mode": "peer", "listen": {"endpoints": [where]}}
    zenoh.board_on(zenoh.opened(LOW_LATENCY | listen), sock)


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    zenoh.decide_on(zenoh.connected(where, LOW_LATENCY))
