"""The one loop behind ``t2 hz``, ``t2 delay`` and ``t2 bw``: listen, and tell once a second."""

import argparse
import sys
import time
from collections.abc import Callable
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import add_key, expression, short
from cli.inspect.payload import read
from cli.inspect.shell import Seat, add_end, add_options, quietly, seated, wants_json, whole
from cli.inspect.stream_stats import Figures, Meter, Taken
from common.bus.publisher import host_id
from common.freshness import NS_PER_S
from common.sample import Sample

TELL_S = 1.0
WINDOW = 10_000

Measure = Callable[[Meter], Figures]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that the three have in common."""
    add_key(parser)
    parser.add_argument(
        "--window", "-w", type=whole, default=WINDOW, metavar="N", help="of the last N samples"
    )
    add_end(parser)
    add_options(parser)


def run(options: argparse.Namespace, name: str, measure: Measure) -> int:
    """Tell once a second until it ends; 0 when anything was heard."""
    with seated(options) as seat:
        meters: dict[str, Meter] = {}
        with quietly():
            wanted = expression(options.key, seat.robot)
            seat.probe.listen(wanted)
            follow(seat, options, meters, name, measure)
    if not meters:
        print(
            f"t2 {name}: no message on {wanted}; `t2 ls` lists the keys that are alive",
            file=sys.stderr,
        )
    return 0 if meters else 1


def follow(
    seat: Seat, options: argparse.Namespace, meters: dict[str, Meter], name: str, measure: Measure
) -> None:
    """Take samples and tell of them, until the duration or the count is over."""
    host = host_id()
    begun_s = told_s = time.monotonic()
    end_s = begun_s + (options.duration or float("inf"))
    silent = True
    while (now_s := time.monotonic()) < end_s:
        heard = seat.probe.take(min(end_s, told_s + TELL_S) - now_s)
        if heard:
            silent = False
            meter = meters.setdefault(short(heard.key, seat.robot), Meter(options.window))
            meter.take(taken(heard, host))
            if options.count and sum(each.count for each in meters.values()) >= options.count:
                break
        if time.monotonic() - told_s >= TELL_S:
            told_s += TELL_S
            if silent:
                print(f"t2 {name}: no new messages", file=sys.stderr)
            else:
                tell(meters, options, measure)
            silent = True
    if not silent:
        tell(meters, options, measure)


def tell(meters: dict[str, Meter], options: argparse.Namespace, measure: Measure) -> None:
    """Print the figures of every key, a JSON line or a row for each."""
    figures = {key: measure(meter) for key, meter in sorted(meters.items())}
    if wants_json(options):
        for key, each in figures.items():
            output.line({"key": key} | each)
        return
    head = [name.replace("_", " ") for name in next(iter(figures.values()))]
    rows = [[key, *(shown(name, value) for name, value in each.items())]
            for key, each in figures.items()]  # fmt: skip
    print(output.table(["key", *head], rows), end="\n\n", flush=True)


def shown(name: str, value: float | int | str | None) -> str:
    """Return a figure for people."""
    if value is None:
        return "-"
    if isinstance(value, str | int):
        return str(value)
    return f"{value:.2f}" if name in ("hz", "bytes_per_s") or value >= 10 else f"{value:.6f}"


def taken(heard: Sample, host: int) -> Taken:
    """Return what a meter wants to know of a sample: its header is read, whatever its type."""
    header = read(heard.payload, heard.encoding).value
    if not isinstance(header, dict):
        return Taken(heard.received_ns, heard.size)
    delay_s, clock = delay(header, heard, host)
    return Taken(
        received_ns=heard.received_ns,
        size=heard.size,
        seq=number(header, "seq"),
        boot=number(header, "boot"),
        delay_s=delay_s,
        clock=clock,
    )


def delay(header: dict[str, Any], heard: Sample, host: int) -> tuple[float | None, str]:
    """Return how long it was under way, and by which clock: this host's own, or two wall clocks."""
    mono_ns, t_ns = number(header, "mono_ns"), number(header, "t_ns")
    if mono_ns and host and header.get("host") == host:
        return (heard.received_ns - mono_ns) / NS_PER_S, "host"
    if t_ns:
        return (heard.wall_ns - t_ns) / NS_PER_S, "wall"
    return None, ""


def number(header: dict[str, Any], name: str) -> int | None:
    """Return a whole number of the header, None when it has none of that name."""
    value = header.get(name)
    return value if isinstance(value, int) else None
