"""What was measured, carried on to more robots, on paper. Pure.

A router's time is taken to grow with the robots that are there and with the messages it passes on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tests.fleet.figures import Window, name, on_the_wire

MONTH_S = 30 * 24 * 3600
SIZES = (1_000, 100_000)


@dataclass(frozen=True, slots=True)
class Cost:
    """What a site's router takes."""

    robot_cpu: float  # of a core, for a robot that nobody looks at
    message_s: float  # of a core's time, for a message that comes in and goes out once
    robot_bytes: float  # of memory


def cost(windows: Sequence[Window]) -> Cost:
    """Return it, of the largest fleet that was measured against the smallest."""
    small, idle, busy = (
        _window(windows, "nobody", min), _window(windows, "nobody", max),
        _window(windows, "everything", max),
    )  # fmt: skip
    robots = idle["robots"]
    return Cost(
        idle["site"]["cpu"] / robots,
        (busy["site"]["cpu"] - idle["site"]["cpu"]) / busy["ear"]["hz"],
        (idle["site"]["rss"] - small["site"]["rss"]) / (robots - small["robots"]),
    )


def scale(windows: Sequence[Window]) -> str:
    """Return a row for each thing that was looked at: of one robot, of a thousand, of more."""
    unit = cost(windows)
    most = max(window["robots"] for window in windows)
    rows = [w for w in windows if w["robots"] == most and w["shape"] == "peer"]
    head = ["looked at", "messages /s of one", "kbit/s of one", "GB a month", "robots on one core"]
    for size in SIZES:
        head += [f"{size:,}: Mbit/s", "cores"]
    lines = [head, ["---"] * len(head)]
    for window in rows:
        light = window["light_link"]
        hz = _hz(window)
        rate = on_the_wire(light, "up") + on_the_wire(light, "down")
        cores = unit.robot_cpu + hz * unit.message_s
        cells = [
            name(window), f"{hz:.0f}", f"{rate * 8 / 1000:.0f}", f"{rate * MONTH_S / 1e9:.1f}",
            f"{1 / cores:,.0f}",
        ]  # fmt: skip
        for size in SIZES:
            cells += [f"{size * rate * 8 / 1e6:,.0f}", f"{size * cores:,.1f}"]
        lines.append(cells)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def units(windows: Sequence[Window]) -> str:
    """Say what a robot and a message cost."""
    unit = cost(windows)
    return (
        f"A message that comes in and goes out once takes {unit.message_s * 1e6:.0f} us of a core, "
        f"a robot that nobody looks at {unit.robot_cpu * 100:.3f} % of it and "
        f"{unit.robot_bytes / 1000:.0f} kB of memory."
    )


def _hz(window: Window) -> float:
    """Return the messages of one light robot that arrived; real ones are not thinned out."""
    if not window["thin"]:
        return float(window["ear"]["hz"]) / float(window["robots"])
    light = window["light"]
    each = light["wanted_hz"] / light["robots"]
    real = window["robots"] - light["robots"]
    arrived: float = window["ear"]["hz"] - real * each
    return max(0.0, arrived) / float(light["robots"])


def _window(windows: Sequence[Window], what: str, pick: Callable[..., Any]) -> Window:
    found = [w for w in windows if w["what"] == what and w["shape"] == "peer" and not w["thin"]]
    picked: Window = pick(found, key=_robots)
    return picked


def _robots(window: Window) -> int:
    return int(window["robots"])
