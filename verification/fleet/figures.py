"""Evaluation of the measurement windows: reaction times of requests, table rows. Pure."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from common.freshness import NS_PER_S
from sim.trace import Command
from verification.harness.results import percentile, table

PATIENCE_NS = NS_PER_S  # a later frame is not the answer
SAME_MPS = 0.0004  # resolution of the wire: 1 mm/s
FULL = 0.95  # of the machine's CPU time
SHORT = 0.98  # of the intended rate

Window = dict[str, Any]  # results of one measurement window, see ``topology.window``


@dataclass(frozen=True, slots=True)
class Request:
    """A motion request: when it was sent, and its speed, which identifies it."""

    mono_ns: int
    linear: float


def answers_s(requests: Sequence[Request], commands: Sequence[Command]) -> list[float | None]:
    """Return the time from each request to its frame at the board; None for a missing frame.

    Consecutive requests have different speeds, so the first frame of that speed is the answer.
    """
    times = [command.mono_ns for command in commands]
    found: list[float | None] = []
    for one in requests:
        took_s = None
        for command in commands[bisect_left(times, one.mono_ns) :]:
            if command.mono_ns > one.mono_ns + PATIENCE_NS:
                break
            if command.kind == "run" and abs(command.linear - one.linear) < SAME_MPS:
                took_s = (command.mono_ns - one.mono_ns) / NS_PER_S
                break
        found.append(took_s)
    return found


def ms(values: Sequence[float], share: float) -> str:
    """Return the percentile of durations in ms, for a table."""
    return f"{1000 * percentile(values, share):.1f}" if values else "-"


def kbit(bytes_per_s: float | None) -> str:
    """Return a bandwidth in kbit/s, for a table."""
    return "-" if bytes_per_s is None else f"{bytes_per_s * 8 / 1000:.0f}"


def on_the_wire(link: dict[str, float], direction: str) -> float:
    """Return bytes per second of one direction, with IPv4 and TCP headers (52 a segment)."""
    return link[direction] + 52 * link[f"{direction}_segments"]


def limits(window: Window) -> str:
    """Return what was saturated, of machine, generator and arrival; empty for nothing."""
    found = []
    if window["machine"]["busy"] > FULL:
        found.append("machine")
    simulated = window["simulated"]
    if simulated and simulated["hz"] < SHORT * simulated["wanted_hz"]:
        found.append("generator")
    if window["subscriber"]["hz"] < SHORT * expected_hz(window):
        found.append("arrival")
    return ", ".join(found)


def expected_hz(window: Window) -> float:
    """Return the rate that should arrive; 0 where it is not known."""
    if window["what"] != "everything" or window["thin"] or not window["simulated"]:
        return 0.0
    simulated = window["simulated"]
    robots: int = simulated["robots"]
    return float(simulated["hz"]) * window["robots"] / robots if robots else 0.0


def markdown(windows: Sequence[Window]) -> str:
    """Return the table of the windows."""
    head = (
        "robots", "subscribed", "put /s", "arrived /s", "age p50 ms", "p99 ms", "site CPU %",
        "site MB", "machine %", "others %", "request p50 ms", "p99 ms", "unanswered", "saturated",
    )  # fmt: skip
    return table(head, map(_cells, windows))


def uplinks(windows: Sequence[Window]) -> str:
    """Return the table of one robot's uplink bandwidth in both directions."""
    head = (
        "robots", "subscribed", "real up kbit/s", "real down", "its router CPU %",
        "simulated up kbit/s", "simulated down", "simulated received kB",
    )  # fmt: skip
    lines = []
    for window in windows:
        real, simulated = window["real_link"], window["simulated_link"]
        lines.append((
            str(window["robots"]), name(window), *(kbit(on_the_wire(real, d)) for d in DIRECTIONS),
            f"{100 * window['parts']['router 0']['cpu']:.1f}",
            *(kbit(on_the_wire(simulated, d) if simulated else None) for d in DIRECTIONS),
            f"{window['simulated_total']['down'] / 1000:.0f}" if simulated else "-",
        ))  # fmt: skip
    return table(head, lines)


def shares(windows: Sequence[Window]) -> str:
    """Return the CPU of each process in percent of a core, with a subscriber of everything."""
    rows = [w for w in windows if w["what"] == "everything"]
    processes = sorted({part for window in rows for part in window["parts"]})
    head = ("robots", "subscribed", *processes)
    lines = []
    for window in rows:
        parts = window["parts"]
        cells = (f"{100 * parts[part]['cpu']:.0f}" if part in parts else "-" for part in processes)
        lines.append((str(window["robots"]), name(window), *cells))
    return table(head, lines)


DIRECTIONS = ("up", "down")


def name(window: Window) -> str:
    """Return the label of a window: the subscription and how the robots connect."""
    thin = f", {window['thin']:g} Hz" if window["thin"] else ""
    shape = f", {window['shape']}s" if window["shape"] != "peer" else ""
    return f"{window['what']}{thin}{shape}"


def _cells(window: Window) -> tuple[str, ...]:
    simulated, subscriber, site = window["simulated"], window["subscriber"], window["site"]
    took = [each for each in window["answers_s"] if each is not None]
    return (
        str(window["robots"]),
        name(window),
        f"{simulated['hz']:.0f}" if simulated else "-",
        f"{subscriber['hz']:.0f}",
        ms(subscriber["ages_s"], 0.5),
        ms(subscriber["ages_s"], 0.99),
        f"{100 * site['cpu']:.0f}",
        f"{site['rss'] / 1e6:.0f}",
        f"{100 * window['machine']['busy']:.0f}",
        f"{100 * window['machine']['others']:.0f}",
        ms(took, 0.5),
        ms(took, 0.99),
        f"{len(window['answers_s']) - len(took)} of {len(window['answers_s'])}",
        limits(window),
    )
