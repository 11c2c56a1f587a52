"""Which call came too late to count. Pure.

A reset that the network held back must not clear a stop that its sender cannot have seen. The
attachment has the sender's clock, and a client that calls once has no fastest delivery to compare
with, as ``command`` does. So the clocks of robot and client must agree as far as the stop is old. A
brake switch that was held back must not undo a later one: its clocks must agree within a second.
"""

import math

from common.freshness import NS_PER_S
from common.messages import SafetyState

TOLERANCE_S = 0.2  # of the two clocks, and of the age of safety's state
SWITCH_S = 1.0  # age of a call of a switch


def reset_refusal(state: SafetyState, sent_ns: int, now_ns: int) -> str:
    """Return why a reset must not clear what this state has latched; empty when it may.

    ``sent_ns`` and ``now_ns`` are the wall clocks of the sender and of the robot.
    """
    age_s = (now_ns - sent_ns) / NS_PER_S
    latched_s = min(
        (cause.age for cause in state.causes if cause.name in state.latched), default=math.inf
    )
    if age_s < -TOLERANCE_S:
        return _ahead(age_s)
    if max(age_s, 0.0) + TOLERANCE_S <= latched_s:
        return ""
    return (
        f"The reset was sent {age_s:.1f} s ago by its sender's clock, and the last stop was "
        f"{latched_s:.1f} s ago. Reset again; if that fails, synchronize the clocks."
    )


def switch_refusal(sent_ns: int, now_ns: int) -> str:
    """Return why a brake switch must not follow a call; empty when it may."""
    age_s = (now_ns - sent_ns) / NS_PER_S
    if age_s < -TOLERANCE_S:
        return _ahead(age_s)
    if age_s <= SWITCH_S:
        return ""
    return f"The call was sent {age_s:.1f} s ago by its sender's clock. Synchronize the clocks."


def _ahead(age_s: float) -> str:
    return f"The sender's clock is {-age_s:.1f} s ahead of the robot's. Synchronize the clocks."
