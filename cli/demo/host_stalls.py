"""Scheduling stalls of this host, and the demo's time limits for them.

On a shared virtual machine processes stall for tenths of a second, and with the limits for a
vehicle's computer safety stops the vehicle all the time. There the demo uses longer limits, and
drives slower: safety's stopping distance includes the reaction time.
"""

import time
from collections.abc import Iterable

LIMIT_S = 0.05  # the shipped limits allow stalls up to this
SAMPLES_S = 0.005

LEAST_S, MOST_S = 0.3, 1.0  # of ``host.stall``
OVERRIDES = "unsafe_overrides="


def measured(seconds: float = 1.5) -> float:
    """Return the longest stall: how much longer a short sleep took than requested, in seconds."""
    worst, last = 0.0, time.monotonic()
    end = last + seconds
    while last < end:
        time.sleep(SAMPLES_S)
        now = time.monotonic()
        worst, last = max(worst, now - last - SAMPLES_S), now
    return worst


def settings(stall_s: float) -> list[str]:
    """Return the settings for stalls of this length, for ``--set``; none for short ones."""
    if stall_s <= LIMIT_S:
        return []
    allowed_s = min(MOST_S, max(LEAST_S, stall_s))
    return [
        f"{OVERRIDES}bus.lease,host.stall",
        "bus.lease=10",
        "bus.probe_deadline=10",
        f"host.stall={allowed_s}",
    ]


def with_overrides_joined(sets: Iterable[str]) -> list[str]:
    """Return the settings with the values of all ``unsafe_overrides`` in one."""
    given = list(sets)
    overrides = [one.removeprefix(OVERRIDES) for one in given if one.startswith(OVERRIDES)]
    joined = [OVERRIDES + ",".join(overrides)] if overrides else []
    return [*joined, *(one for one in given if not one.startswith(OVERRIDES))]
