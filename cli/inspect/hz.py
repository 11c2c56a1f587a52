"""``t2 hz``: rate, gaps, losses, bandwidth and transport delay of keys, in one table.

The delay is by the host's monotonic clock where sender and receiver share it (clock ``host``), else
by both wall clocks, whose offset is then part of the result (clock ``wall``). Bandwidth counts
payloads and attachments, without the protocol overhead.
"""

import argparse
import time

from cli.inspect import output
from cli.inspect.addressing import add_key, expression, short
from cli.inspect.session import BusSession, add_end, add_options, open_session, until_interrupt
from cli.inspect.stream_stats import StreamStats
from common.bus.publisher import host_id
from common.errors import RobotError

REPORT_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser)
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
    reported_s = time.monotonic()
    end_s = reported_s + (options.duration or float("inf"))
    new = 0  # since the last report
    while (now_s := time.monotonic()) < end_s:
        if sample := session.probe.take(min(end_s, reported_s + REPORT_S) - now_s):
            new += 1
            key = short(sample.key, session.robot)
            streams.setdefault(key, StreamStats(host)).add(sample)
            if sum(each.count for each in streams.values()) == options.count:
                break
        if time.monotonic() - reported_s >= REPORT_S:
            reported_s += REPORT_S
            report(streams, options) if new else output.warn("t2 hz: no new messages")
            new = 0
    if new:
        report(streams, options)


def report(streams: dict[str, StreamStats], options: argparse.Namespace) -> None:
    """Print the figures of every key."""
    rows = [{"key": key, **stats.figures()} for key, stats in sorted(streams.items())]
    output.rows(rows, as_json=options.json)
    if not options.json:
        print(flush=True)
