"""The first part between a screen and the wheels that is missing, and what follows from it. Pure.

Safety reports what it lacks, so a missing part shows as several causes of it. A screen names the
part, in this order, and folds the causes below it. It changes no decision. The text of a part is
``root.PART`` in the catalogue.

====== ===========================================================================
part   missing when
====== ===========================================================================
router there is no connection
safety no state of safety arrives
bridge no state of the link arrives, and safety lacks data, too
relay  the bridge reports that the configured relay is silent
board  the bridge reports that the board is silent
====== ===========================================================================
"""

from typing import Literal

from msgspec import Struct

from t2.messages import CauseName, Link, SafetyState

Part = Literal["", "router", "safety", "bridge", "relay", "board"]

# Causes of safety that it has without a bridge, and others that follow from a missing bridge, relay
# or board. One that latches, or that brakes a moving vehicle, is not among them.
WITHOUT_BRIDGE: tuple[CauseName, ...] = ("starting", "bumper", "silent", "link")
FROM_LINK: tuple[CauseName, ...] = (*WITHOUT_BRIDGE, "sonar", "switches", "unarmed")


class RootCause(Struct, frozen=True):
    """The missing part; empty if there is none."""

    part: Part = ""
    folded: tuple[CauseName, ...] = ()  # names of safety's causes that follow from it


def root_cause(connected: bool, state: SafetyState | None, link: Link | None) -> RootCause:
    """Return what is missing first; None stands for a message that is too old or never came."""
    if not connected:
        return RootCause("router")
    if state is None:
        return RootCause("safety")
    folded = tuple(cause.name for cause in state.causes if cause.name in FROM_LINK)
    if link is None:
        is_missing = not set(WITHOUT_BRIDGE).isdisjoint(folded)  # not only late on this network
        return RootCause("bridge", folded) if is_missing else RootCause()
    if link.state == "up":
        return RootCause()
    is_relay = link.relay is not None and link.relay.state != "up"
    return RootCause("relay" if is_relay else "board", folded)
