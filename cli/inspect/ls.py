"""``t2 ls``: the keys that are alive, with type, rate and publisher.

Alive is what came while it listened, and what somebody has declared to publish.
"""

import argparse
import sys
from dataclasses import dataclass, field
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERYTHING, add_key, chunks, expression, short, topic_of
from cli.inspect.discovery import present
from cli.inspect.graph import Member, by_boot, publishers, title
from cli.inspect.measure import taken
from cli.inspect.shell import Seat, add_options, positive, quietly, seated, wants_json
from cli.inspect.stream_stats import Meter
from common import codec
from common.bus.probe import intersects
from common.sample import Sample

LISTEN_S = 2.0  # two of the slowest streams
WINDOW = 10_000
NO_STREAMS = ("live/", "info/", "srv/")


@dataclass(slots=True)
class Stream:
    """What is known of one key."""

    kind: str = ""
    meter: Meter = field(default_factory=lambda: Meter(WINDOW))
    boots: set[int] = field(default_factory=set)
    publishers: set[str] = field(default_factory=set)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser, optional=True)
    parser.add_argument(
        "--duration", type=positive, default=LISTEN_S, metavar="S",
        help=f"listen so long, {LISTEN_S:g} s by default",
    )  # fmt: skip
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List what is alive; 1 when nothing is."""
    with seated(options) as seat:
        words = [options.key] if options.key else EVERYTHING
        wanted = [expression(word, seat.robot) for word in words]
        streams = heard(seat, wanted, options.duration)
        who = present(seat.probe, seat.robot)
    name(streams, who, wanted)
    if not streams:
        print(f"t2 ls: nothing is alive on {', '.join(wanted)}; try `t2 doctor`", file=sys.stderr)
        return 1
    show(streams, seat.robot, wants_json(options))
    return 0


def heard(seat: Seat, wanted: list[str], seconds: float) -> dict[str, Stream]:
    """Return what came on these keys within so many seconds."""
    streams: dict[str, Stream] = {}
    for each in wanted:
        seat.probe.listen(each)
    with quietly():
        for sample in seat.probe.samples(seconds):
            _note(streams.setdefault(sample.key, Stream()), sample)
    return streams


def name(streams: dict[str, Stream], who: list[Member], wanted: list[str]) -> None:
    """Add who publishes, and the keys that nobody has put anything on while we listened."""
    boots = by_boot(who)
    for key, names in publishers(who).items():
        if any(intersects(key, each) for each in wanted) and _is_stream(key):
            streams.setdefault(key, Stream()).publishers.update(names)
    for key, stream in streams.items():
        stream.publishers |= {title(boots[boot], who) for boot in stream.boots if boot in boots}
        topic = topic_of(key)
        if topic and not stream.kind:
            stream.kind = topic.message.__name__


def show(streams: dict[str, Stream], robot: str, as_json: bool) -> None:
    """Print a line of JSON or a row for each key."""
    rows = [_row(key, streams[key], robot) for key in sorted(streams)]
    if as_json:
        for row in rows:
            output.line(row)
        return
    cells = [
        [row["key"], row["type"] or "?", _hz(row["hz"]), _expected(row["expected_hz"]),
         ", ".join(row["publishers"]) or "?"]
        for row in rows
    ]  # fmt: skip
    print(output.table(["key", "type", "Hz", "of", "publisher"], cells))


def _note(stream: Stream, sample: Sample) -> None:
    one = taken(sample, 0)
    stream.meter.take(one)
    stream.kind = codec.kind_of(sample.encoding) or stream.kind
    if one.boot:
        stream.boots.add(one.boot)


def _row(key: str, stream: Stream, robot: str) -> dict[str, Any]:
    topic = topic_of(key)
    return {
        "key": short(key, robot),
        "type": stream.kind,
        "hz": stream.meter.rate()["hz"],
        "expected_hz": topic.rate_hz if topic else None,
        "publishers": sorted(stream.publishers),
    }


def _is_stream(key: str) -> bool:
    return not chunks(key)[1].startswith(NO_STREAMS) and "*" not in key


def _hz(hz: float | None) -> str:
    return "-" if hz is None else f"{hz:.1f}"


def _expected(hz: float | None) -> str:
    if hz is None:
        return ""
    return f"{hz:g}" if hz else "change"
