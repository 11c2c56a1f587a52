"""What was measured, carried on to more robots, on paper. Pure.

A row's cost of one robot is what the site's router took in the largest fleet, divided by its
robots. It is not put together from messages: these get cheaper the more come at a time.
"""

from collections.abc import Sequence

from verification.fleet.figures import Window, name, on_the_wire

MONTH_S = 30 * 24 * 3600
SIZES = (1_000, 100_000)


def scale(windows: Sequence[Window]) -> str:
    """Return a row for each thing that was looked at: of one robot, of a thousand, of more."""
    most = max(window["robots"] for window in windows)
    head = ["looked at", "messages /s of one", "kbit/s of one", "GB a month", "robots on one core"]
    for size in SIZES:
        head += [f"{size:,}: Mbit/s", "cores"]
    lines = [head, ["---"] * len(head)]
    lines += [_cells(w) for w in windows if w["robots"] == most and w["shape"] == "peer"]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def units(windows: Sequence[Window]) -> str:
    """Say what a message and a robot cost, from the smallest fleet to the largest."""
    idle = _of(windows, "nobody")
    busy = [w for w in _of(windows, "everything") if w["light"]]
    told = [f"{_message_us(w):.0f} us with {w['robots']} robots" for w in busy]
    more = idle[-1]["robots"] - idle[0]["robots"]
    memory = (idle[-1]["site"]["rss"] - idle[0]["site"]["rss"]) / more
    return (
        "A message that comes in and goes out once takes this much of a core: "
        f"{', '.join(told)}. A robot takes {memory / 1000:.0f} kB of the router's memory."
    )


def _cells(window: Window) -> list[str]:
    light = window["light_link"]
    rate = on_the_wire(light, "up") + on_the_wire(light, "down")
    cores = float(window["site"]["cpu"]) / float(window["robots"])
    cells = [
        name(window), f"{_hz(window):.0f}", f"{rate * 8 / 1000:.0f}",
        f"{rate * MONTH_S / 1e9:.1f}", f"{1 / cores:,.0f}",
    ]  # fmt: skip
    for size in SIZES:
        cells += [f"{size * rate * 8 / 1e6:,.0f}", f"{size * cores:,.1f}"]
    return cells


def _message_us(window: Window) -> float:
    return float(window["site"]["cpu"]) / float(window["ear"]["hz"]) * 1e6


def _hz(window: Window) -> float:
    """Return the messages of one light robot that arrived; real ones are not thinned out."""
    if not window["thin"]:
        return float(window["ear"]["hz"]) / float(window["robots"])
    light = window["light"]
    each = light["wanted_hz"] / light["robots"]
    real = window["robots"] - light["robots"]
    arrived: float = window["ear"]["hz"] - real * each
    return max(0.0, arrived) / float(light["robots"])


def _of(windows: Sequence[Window], what: str) -> list[Window]:
    """Return the windows of what was looked at, the smallest fleet first."""
    found = [w for w in windows if w["what"] == what and w["shape"] == "peer" and not w["thin"]]
    return sorted(found, key=_robots)


def _robots(window: Window) -> int:
    return int(window["robots"])
