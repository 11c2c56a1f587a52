"""``t2 hz``: rate, gaps, losses, bandwidth and transport delay of keys, in one table.

Figures cover the last ``WINDOW`` samples of a key. ``lost`` counts gaps of ``seq`` since the start:
published and not received.

The delay is by both wall clocks, whose offset is part of the result. Bandwidth counts payloads and
attachments, without the protocol overhead.
"""

import argparse
import time
from collections import defaultdict, deque
from itertools import pairwise
from statistics import fmean
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import add_key, expression, short
from cli.inspect.payload import read
from cli.inspect.session import (
    BusSession,
    add_duration,
    add_options,
    open_session,
    until_interrupt,
)
from common.cli_args import hint, source_words
from common.freshness import NS_PER_S
from t2.codec import Sample
from t2.errors import T2Error

REPORT_S = 1.0
WINDOW = 10_000
PARTS = {"p50": 0.50, "p99": 0.99, "max": 1.0}


class StreamStats:
    """Statistics of one key."""

    def __init__(self) -> None:
        self.lost = 0
        self._sender: tuple[int, int] = (0, 0)  # boot and seq of the newest sample
        self._received: deque[tuple[int, int]] = deque(maxlen=WINDOW)  # time in ns, size
        self._delays_s: deque[float] = deque(maxlen=WINDOW)

    def add(self, sample: Sample) -> None:
        """Add a sample; its header is read, whatever its type."""
        self._received.append((sample.received_ns, sample.size))
        header = read(sample.payload, sample.encoding).value
        if not isinstance(header, dict):
            return
        numbers = {name: value for name, value in header.items() if isinstance(value, int)}
        before, self._sender = self._sender, (numbers.get("boot", 0), numbers.get("seq", 0))
        if before[1] and before[0] == self._sender[0]:
            self.lost += max(0, self._sender[1] - before[1] - 1)
        if numbers.get("t_ns"):
            self._delays_s.append((sample.wall_ns - numbers["t_ns"]) / NS_PER_S)

    def figures(self) -> dict[str, Any]:
        """Return all figures; None where samples are missing, or their timestamps."""
        stamps = [received_ns for received_ns, _ in self._received]
        gaps = [(later - earlier) / NS_PER_S for earlier, later in pairwise(stamps)]
        sizes = [size for _, size in self._received]
        delays = sorted(self._delays_s)
        span_s = (stamps[-1] - stamps[0]) / NS_PER_S if stamps else 0.0
        return {
            "hz": (len(stamps) - 1) / span_s if span_s else None,
            "gap_min": min(gaps, default=None),
            "gap_max": max(gaps, default=None),
            "lost": self.lost,
            # The first sample only starts the interval.
            "bytes_per_s": sum(sizes[1:]) / span_s if span_s else None,
            "bytes": fmean(sizes) if sizes else None,
            **{f"delay_{name}": quantile(delays, part) for name, part in PARTS.items()},
        }


def quantile(rising: list[float], part: float) -> float | None:
    """Return the quantile ``part`` (0 to 1) of sorted values."""
    return rising[min(len(rising) - 1, int(part * len(rising)))] if rising else None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser)
    add_duration(parser)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Report once a second; raise ``T2Error`` if no message arrived."""
    streams: defaultdict[str, StreamStats] = defaultdict(StreamStats)
    with open_session(options) as session:
        wanted = expression(options.key, session.robot)
        session.inspector.listen(wanted)
        with until_interrupt():
            follow(session, options, streams)
    if not streams:
        active = hint("ls", source_words(options))
        raise T2Error(f"no message on {wanted}; {active} lists the active keys")
    return 0


def follow(
    session: BusSession, options: argparse.Namespace, streams: defaultdict[str, StreamStats]
) -> None:
    """Measure and report until the duration is over."""
    end_s = time.monotonic() + (options.duration or float("inf"))
    while (left_s := end_s - time.monotonic()) > 0:
        new = False
        for sample in session.inspector.samples(min(REPORT_S, left_s)):
            streams[short(sample.key, session.robot)].add(sample)
            new = True
        if new:
            report(streams, options)
        else:
            output.warn("t2 hz: no new messages")


def report(streams: dict[str, StreamStats], options: argparse.Namespace) -> None:
    """Print the figures of every key."""
    rows = [{"key": key, **stats.figures()} for key, stats in sorted(streams.items())]
    output.rows(rows, as_json=options.json)
    if not options.json:
        print(flush=True)
