"""``t2 hz``, ``t2 delay`` and ``t2 bw``: rate, transport delay and bandwidth of keys.

``hz`` shows the average rate, the gaps between two samples, and samples lost by ``seq``. ``delay``
uses the host's monotonic clock where sender and receiver share it (clock ``host``), else both wall
clocks, whose offset is then part of the result (clock ``wall``). ``bw`` counts payloads and
attachments, without the protocol overhead.
"""

import argparse
import time

from cli.inspect import output
from cli.inspect.addressing import add_key, expression, short
from cli.inspect.payload import read
from cli.inspect.session import (
    BusSession,
    add_end,
    add_options,
    open_session,
    until_interrupt,
    whole,
)
from cli.inspect.stream_stats import StreamSample, StreamStats
from common.bus.publisher import host_id
from common.codec import Sample
from common.errors import RobotError
from common.freshness import NS_PER_S

REPORT_S = 1.0
WINDOW = 10_000
MEASURES = {"hz": StreamStats.rate, "delay": StreamStats.delay, "bw": StreamStats.bandwidth}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the three commands."""
    add_key(parser)
    parser.add_argument(
        "--window", "-w", type=whole, default=WINDOW, metavar="N", help="of the last N samples"
    )
    add_end(parser)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Report once a second; raise ``RobotError`` if no message arrived."""
    streams: dict[str, StreamStats] = {}
    with open_session(options) as session:
        wanted = expression(options.key, session.robot)
        with until_interrupt():
            session.probe.listen(wanted)
            follow(session, options, streams)
    if not streams:
        raise RobotError(f"no message on {wanted}; `t2 ls` lists the active keys")
    return 0


def follow(
    session: BusSession, options: argparse.Namespace, streams: dict[str, StreamStats]
) -> None:
    """Measure and report until the duration or the count is reached."""
    host = host_id()
    begun_s = reported_s = time.monotonic()
    end_s = begun_s + (options.duration or float("inf"))
    silent = True
    while (now_s := time.monotonic()) < end_s:
        sample = session.probe.take(min(end_s, reported_s + REPORT_S) - now_s)
        if sample:
            silent = False
            key = short(sample.key, session.robot)
            streams.setdefault(key, StreamStats(options.window)).add(stream_sample(sample, host))
            if options.count and sum(each.count for each in streams.values()) >= options.count:
                break
        if time.monotonic() - reported_s >= REPORT_S:
            reported_s += REPORT_S
            if silent:
                output.warn(f"t2 {options.command}: no new messages")
            else:
                report(streams, options)
            silent = True
    if not silent:
        report(streams, options)


def report(streams: dict[str, StreamStats], options: argparse.Namespace) -> None:
    """Print the figures of every key."""
    measure = MEASURES[options.command]
    rows = [{"key": key, **measure(stats)} for key, stats in sorted(streams.items())]
    head = [column.replace("_", " ") for column in rows[0]]
    output.rows(rows, head, lambda row: list(map(cell, row, row.values())), options.output)
    if options.output != "json":
        print(flush=True)


def cell(name: str, value: float | int | str | None) -> str:
    """Return a figure as text."""
    if value is None:
        return "-"
    if isinstance(value, str | int):
        return str(value)
    return f"{value:.2f}" if name in ("hz", "bytes_per_s") or value >= 10 else f"{value:.6f}"


def stream_sample(sample: Sample, host: int) -> StreamSample:
    """Return the measured values of a sample; its header is read, whatever its type."""
    header = read(sample.payload, sample.encoding).value
    if not isinstance(header, dict):
        return StreamSample(sample.received_ns, sample.size)
    numbers = {name: value for name, value in header.items() if isinstance(value, int)}
    delay_s, clock = None, ""
    if numbers.get("mono_ns") and host and numbers.get("host") == host:
        delay_s, clock = (sample.received_ns - numbers["mono_ns"]) / NS_PER_S, "host"
    elif numbers.get("t_ns"):
        delay_s, clock = (sample.wall_ns - numbers["t_ns"]) / NS_PER_S, "wall"
    seq, boot = numbers.get("seq"), numbers.get("boot")
    return StreamSample(sample.received_ns, sample.size, seq, boot, delay_s, clock)
