"""``t2 ls``: the active keys with type, rate and publisher.

A key is active if a message arrives on it while the command listens, or if a publisher is declared.
"""

import argparse
from dataclasses import dataclass, field
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERYTHING, add_key, chunks, expression, short, topic_of
from cli.inspect.graph import Member, by_boot, title
from cli.inspect.measure import WINDOW, stream_sample
from cli.inspect.services import discover
from cli.inspect.session import BusSession, add_duration, add_options, open_session, until_interrupt
from cli.inspect.stream_stats import StreamStats
from common import codec
from common.bus.probe import intersects
from common.codec import Sample
from common.errors import RobotError

LISTEN_S = 2.0  # two periods of the slowest streams
NO_STREAMS = ("live/", "info/", "srv/")  # tokens and calls
HEAD = ("key", "type", "Hz", "of", "publisher")


@dataclass(slots=True)
class Stream:
    """One key with its type, rate and publishers."""

    kind: str = ""
    stats: StreamStats = field(default_factory=lambda: StreamStats(WINDOW))
    boots: set[int] = field(default_factory=set)
    publishers: set[str] = field(default_factory=set)

    def add(self, sample: Sample) -> None:
        """Add a sample."""
        measured = stream_sample(sample, 0)
        self.stats.add(measured)
        self.kind = codec.kind_of(sample.encoding) or self.kind
        if measured.boot:
            self.boots.add(measured.boot)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser, optional=True)
    add_duration(parser, LISTEN_S)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the active keys; raise ``RobotError`` without any."""
    with open_session(options) as session:
        words = [options.key] if options.key else EVERYTHING
        wanted = [expression(word, session.robot) for word in words]
        streams = listen(session, wanted, options.duration)
        add_publishers(streams, discover(session.probe, session.robot), wanted)
    if not streams:
        raise RobotError(f"no active key on {', '.join(wanted)}; try `t2 doctor`")
    rows = [as_json(key, streams[key], session.robot) for key in sorted(streams)]
    output.rows(rows, HEAD, as_cells, options.output)
    return 0


def listen(session: BusSession, wanted: list[str], seconds: float) -> dict[str, Stream]:
    """Return the streams that arrive on these keys."""
    streams: dict[str, Stream] = {}
    for each in wanted:
        session.probe.listen(each)
    with until_interrupt():
        for sample in session.probe.samples(seconds):
            streams.setdefault(sample.key, Stream()).add(sample)
    return streams


def add_publishers(streams: dict[str, Stream], found: list[Member], wanted: list[str]) -> None:
    """Add the publishers, and the declared keys on which no message arrived."""
    boots = by_boot(found)
    for member in found:
        for key in member.publishes:
            is_stream = not chunks(key)[1].startswith(NO_STREAMS) and "*" not in key
            if is_stream and any(intersects(key, each) for each in wanted):
                streams.setdefault(key, Stream()).publishers.add(title(member, found))
    for key, stream in streams.items():
        stream.publishers |= {title(boots[boot], found) for boot in stream.boots if boot in boots}
        topic = topic_of(key)
        if topic and not stream.kind:
            stream.kind = topic.message.__name__


def as_json(key: str, stream: Stream, robot: str) -> dict[str, Any]:
    """Return one stream as a JSON object."""
    topic = topic_of(key)
    return {
        "key": short(key, robot),
        "type": stream.kind,
        "hz": stream.stats.rate()["hz"],
        "expected_hz": topic.rate_hz if topic else None,
        "publishers": sorted(stream.publishers),
    }


def as_cells(row: output.Row) -> list[str]:
    """Return one stream as table cells; a topic without a rate is published on change."""
    hz, expected_hz = row["hz"], row["expected_hz"]
    return [
        row["key"],
        row["type"] or "?",
        "-" if hz is None else f"{hz:.1f}",
        "" if expected_hz is None else f"{expected_hz:g}" if expected_hz else "change",
        ", ".join(row["publishers"]) or "?",
    ]
