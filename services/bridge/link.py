"""Whether the board is there, and which of our two ports to believe.

The board sends the same to both ports (manual 1). One is active, the first named at the start; what
comes to the other is dropped, unless the active one has been silent for the failover time: then the
other takes over. So nothing is taken twice, and one dead port costs no link.

``never`` --frame--> ``up`` --silence--> ``lost`` --frame--> ``up``
"""

from msgspec import Struct
from msgspec.structs import replace

from common.messages import LinkState


class Link(Struct, frozen=True):
    """What was heard of the board, and where."""

    state: LinkState = "never"
    heard_ns: int = 0
    up_ns: int = 0  # when it came up last
    active: int = 0  # index of the port that is believed


def believes(link: Link, port: int, now_ns: int, failover_ns: int) -> bool:
    """Tell whether a datagram on this port counts."""
    silent = link.state == "never" or now_ns - link.heard_ns > failover_ns
    return port == link.active or silent


def on_frame(link: Link, port: int, now_ns: int) -> Link:
    """Take in a valid frame on a port that is believed."""
    up_ns = link.up_ns if link.state == "up" else now_ns
    return replace(link, state="up", heard_ns=now_ns, up_ns=up_ns, active=port)


def on_tick(link: Link, now_ns: int, silence_ns: int) -> Link:
    """Notice that the board has been silent for too long."""
    if link.state == "up" and now_ns - link.heard_ns > silence_ns:
        return replace(link, state="lost")
    return link
