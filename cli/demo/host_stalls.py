"""Scheduling stalls of this host, and the demo's time limits for them.

On a shared virtual machine processes stall for tenths of a second, and with the limits for a
vehicle's computer safety stops the vehicle all the time. There the demo uses longer limits, and
drives slower: safety's stopping distance includes the reaction time.
"""

import time
from collections.abc import Iterable

LIMIT_S = 0.05  # the shipped limits allow stalls up to this
SAMPLES_S = 0.005

LEAST_S, MOST_S = 0.3, 1.0  # of the settings


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
        "bus.unsafe_overrides=lease",
        "bus.lease=10",
        "bus.probe_deadline=10",
        "bridge.unsafe_overrides=stall",
        f"bridge.stall={allowed_s}",
        "safety.unsafe_overrides=stall",
        f"safety.stall={allowed_s}",
    ]


def with_accepted_joined(sets: Iterable[str]) -> list[str]:
    """Return the settings with the values of ``unsafe_overrides`` joined per section."""
    accepted: dict[str, list[str]] = {}
    others = []
    for given in sets:
        name, _, value = given.partition("=")
        if name.endswith(".unsafe_overrides"):
            accepted.setdefault(name, []).append(value.strip("[]"))
        else:
            others.append(given)
    return [*(f"{name}={','.join(values)}" for name, values in accepted.items()), *others]
