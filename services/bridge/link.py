"""Whether the board is there.

``never`` --frame--> ``up`` --silence--> ``lost`` --frame--> ``up``
"""

from msgspec import Struct
from msgspec.structs import replace

from common.messages import LinkState


class Link(Struct, frozen=True):
    """What the board sent, on either of our ports."""

    state: LinkState = "never"
    heard_ns: int = 0
    up_ns: int = 0  # when it came up last


def on_frame(link: Link, now_ns: int) -> Link:
    """Take in a valid frame."""
    up_ns = link.up_ns if link.state == "up" else now_ns
    return replace(link, state="up", heard_ns=now_ns, up_ns=up_ns)


def on_tick(link: Link, now_ns: int, silence_ns: int) -> Link:
    """Notice that the board has been silent for too long."""
    if link.state == "up" and now_ns - link.heard_ns > silence_ns:
        return replace(link, state="lost")
    return link
