"""What comes of the windows of a measurement: answers to requests, rows of a table. Pure."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sim.trace import Command
from verification.harness.results import percentile

S = 1_000_000_000
PATIENCE_NS = S  # a frame that comes later answers nothing
SAME_MPS = 0.0004  # the wire counts millimetres per second
FULL = 0.95  # of a machine's time: nothing is left
SHORT = 0.98  # of the wanted rate: the generator does not keep up

Window = dict[str, Any]  # what was measured in one; see __main__.py


@dataclass(frozen=True, slots=True)
class Asked:
    """A request to move: when it was sent, and the speed that is known by."""

    mono_ns: int
    linear: float


def answers_s(asked: Sequence[Asked], commands: Sequence[Command]) -> list[float | None]:
    """Return how long each request took to be a frame at the board; None for those that were not.

    Each request is for another speed than the one before it, so the first frame of that speed is
    its answer.
    """
    times = [command.mono_ns for command in commands]
    found: list[float | None] = []
    for one in asked:
        took_s = None
        for command in commands[bisect_left(times, one.mono_ns) :]:
            if command.mono_ns > one.mono_ns + PATIENCE_NS:
                break
            if command.kind == "run" and abs(command.linear - one.linear) < SAME_MPS:
                took_s = (command.mono_ns - one.mono_ns) / S
                break
        found.append(took_s)
    return found


def ms(values: Sequence[float], share: float) -> str:
    """Return what this share of durations does not exceed, for a table."""
    return f"{1000 * percentile(values, share):.1f}" if values else "-"


def kbit(bytes_per_s: float | None) -> str:
    """Return a bandwidth for a table, in kbit/s."""
    return "-" if bytes_per_s is None else f"{bytes_per_s * 8 / 1000:.0f}"


def on_the_wire(link: dict[str, float], way: str) -> float:
    """Return bytes per second of one way with the headers of IPv4 and TCP (52 a segment)."""
    return link[way] + 52 * link[f"{way}_segments"]


def limits(window: Window) -> str:
    """Say what was at its end, of generator and machine; empty when nothing was."""
    found = []
    if window["machine"]["busy"] > FULL:
        found.append("machine")
    light = window["light"]
    if light and light["hz"] < SHORT * light["wanted_hz"]:
        found.append("generator")
    if window["ear"]["hz"] < SHORT * expected_hz(window):
        found.append("arrival")
    return ", ".join(found)


def expected_hz(window: Window) -> float:
    """Return what should arrive of what was put; 0 where that is not known."""
    if window["what"] != "everything" or window["thin"] or not window["light"]:
        return 0.0
    light = window["light"]
    robots: int = light["robots"]
    return float(light["hz"]) * window["robots"] / robots if robots else 0.0


def markdown(windows: Sequence[Window]) -> str:
    """Return a row for each window."""
    head = (
        "robots", "looked at", "put /s", "arrived /s", "age p50 ms", "p99 ms", "site CPU %",
        "site MB", "machine %", "others %", "request p50 ms", "p99 ms", "unanswered", "saturated",
    )  # fmt: skip
    lines = [head, ("---",) * len(head), *map(_cells, windows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def uplinks(windows: Sequence[Window]) -> str:
    """Return the bandwidth of one robot's uplink, each way, for each thing looked at."""
    head = (
        "robots", "looked at", "real up kbit/s", "real down", "its router CPU %", "light up kbit/s",
        "light down", "light received kB",
    )  # fmt: skip
    lines = [head, ("---",) * len(head)]
    for window in windows:
        real, light = window["real_link"], window["light_link"]
        lines.append((
            str(window["robots"]), name(window), *(kbit(on_the_wire(real, way)) for way in WAYS),
            f"{100 * window['parts']['router 0']['cpu']:.1f}",
            *(kbit(on_the_wire(light, way) if light else None) for way in WAYS),
            f"{window['light_total']['down'] / 1000:.0f}" if light else "-",
        ))  # fmt: skip
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def shares(windows: Sequence[Window]) -> str:
    """Return who took the CPU, in percent of a core, where everything was looked at."""
    rows = [w for w in windows if w["what"] == "everything"]
    who = sorted({part for window in rows for part in window["parts"]})
    lines = [("robots", "looked at", *who), ("---",) * (len(who) + 2)]
    for window in rows:
        parts = window["parts"]
        cells = (f"{100 * parts[part]['cpu']:.0f}" if part in parts else "-" for part in who)
        lines.append((str(window["robots"]), name(window), *cells))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


WAYS = ("up", "down")


def name(window: Window) -> str:
    """Return what was looked at, and how."""
    thin = f", {window['thin']:g} Hz" if window["thin"] else ""
    shape = f", {window['shape']}s" if window["shape"] != "peer" else ""
    return f"{window['what']}{thin}{shape}"


def _cells(window: Window) -> tuple[str, ...]:
    light, ear, site = window["light"], window["ear"], window["site"]
    took = [each for each in window["answers_s"] if each is not None]
    return (
        str(window["robots"]),
        name(window),
        f"{light['hz']:.0f}" if light else "-",
        f"{ear['hz']:.0f}",
        ms(ear["ages_s"], 0.5),
        ms(ear["ages_s"], 0.99),
        f"{100 * site['cpu']:.0f}",
        f"{site['rss'] / 1e6:.0f}",
        f"{100 * window['machine']['busy']:.0f}",
        f"{100 * window['machine']['others']:.0f}",
        ms(took, 0.5),
        ms(took, 0.99),
        f"{len(window['answers_s']) - len(took)} of {len(window['answers_s'])}",
        limits(window),
    )
