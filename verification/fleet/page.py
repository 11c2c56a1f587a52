"""Extrapolation of the measurement to more robots. Pure.

The cost of one robot is the CPU of the site's router in the largest fleet, divided by its robots.
It is not a sum over messages: their cost falls with their rate.
"""

from collections.abc import Sequence

from verification.fleet.figures import Window, name, on_the_wire
from verification.harness.results import table

MONTH_S = 30 * 24 * 3600
SIZES = (1_000, 100_000)


def scale(windows: Sequence[Window]) -> str:
    """Return the table for one robot, a thousand robots and more."""
    most = max(window["robots"] for window in windows)
    head = ["subscribed", "messages /s of one", "kbit/s of one", "GB a month", "robots on one core"]
    for size in SIZES:
        head += [f"{size:,}: Mbit/s", "cores"]
    rows = [_cells(w) for w in windows if w["robots"] == most and w["shape"] == "peer"]
    return table(head, rows)


def units(windows: Sequence[Window]) -> str:
    """Return the sentence on the cost of a message and a robot."""
    idle = _of(windows, "nothing")
    busy = [w for w in _of(windows, "everything") if w["simulated"]]
    costs = [f"{_message_us(w):.0f} us with {w['robots']} robots" for w in busy]
    more = idle[-1]["robots"] - idle[0]["robots"]
    memory = (idle[-1]["site"]["rss"] - idle[0]["site"]["rss"]) / more
    return (
        "A message that arrives and is forwarded once takes this much of a core: "
        f"{', '.join(costs)}. A robot takes {memory / 1000:.0f} kB of the router's memory."
    )


def _cells(window: Window) -> list[str]:
    simulated = window["simulated_link"]
    rate = on_the_wire(simulated, "up") + on_the_wire(simulated, "down")
    cores = float(window["site"]["cpu"]) / float(window["robots"])
    cells = [
        name(window), f"{_hz(window):.0f}", f"{rate * 8 / 1000:.0f}",
        f"{rate * MONTH_S / 1e9:.1f}", f"{1 / cores:,.0f}",
    ]  # fmt: skip
    for size in SIZES:
        cells += [f"{size * rate * 8 / 1e6:,.0f}", f"{size * cores:,.1f}"]
    return cells


def _message_us(window: Window) -> float:
    return float(window["site"]["cpu"]) / float(window["subscriber"]["hz"]) * 1e6


def _hz(window: Window) -> float:
    """Return the arrived rate of one simulated robot; real robots are not downsampled."""
    if not window["thin"]:
        return float(window["subscriber"]["hz"]) / float(window["robots"])
    simulated = window["simulated"]
    each = simulated["wanted_hz"] / simulated["robots"]
    real = window["robots"] - simulated["robots"]
    arrived: float = window["subscriber"]["hz"] - real * each
    return max(0.0, arrived) / float(simulated["robots"])


def _of(windows: Sequence[Window], what: str) -> list[Window]:
    """Return the windows of a subscription, the smallest fleet first."""
    found = [w for w in windows if w["what"] == what and w["shape"] == "peer" and not w["thin"]]
    return sorted(found, key=_robots)


def _robots(window: Window) -> int:
    return int(window["robots"])
