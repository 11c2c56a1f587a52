"""``t2 ls``: the active keys with type, rate, publishers and readers; ``--services``: the services.

A key is active if a message arrives on it while the command listens, or if a publisher is declared.
Keys that begin with ``@`` are missing from the router's lists: their publishers are known by their
messages, and of their readers only that one exists.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import EVERYTHING, add_key, chunks, expression, short, topic_of
from cli.inspect.members import Member, by_boot, discover, title
from cli.inspect.session import (
    BusSession,
    add_duration,
    add_options,
    open_session,
    until_interrupt,
    wants_json,
)
from cli.inspect.stream_stats import StreamStats, stream_sample
from common import codec
from common.bus.probe import Probe, intersects
from common.codec import Sample
from common.errors import RobotError
from common.text import printable

LISTEN_S = 2.0  # two periods of the slowest streams
WINDOW = 10_000
NO_STREAMS = ("live/", "info/", "srv/")  # tokens and calls
UNLISTED = "@cmd/"  # keys that the router does not list
SOMEONE = "?"
HEAD = ("key", "type", "Hz", "of", "publishers", "readers")
CLOSED = "the router does not show readers and publishers (its admin space is closed)"


@dataclass(slots=True)
class Stream:
    """One key with its type, rate, publishers and readers."""

    kind: str = ""
    stats: StreamStats = field(default_factory=lambda: StreamStats(WINDOW))
    boots: set[int] = field(default_factory=set)
    publishers: set[str] = field(default_factory=set)
    readers: set[str] = field(default_factory=set)

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
    parser.add_argument(
        "--services", action="store_true", help="the services, and what each publishes and reads"
    )
    add_duration(parser, LISTEN_S)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """List the active keys, or the services; raise ``RobotError`` without any."""
    with open_session(options) as session:
        if options.services:
            return list_services(session, options)
        words = [options.key] if options.key else EVERYTHING
        wanted = [expression(word, session.robot) for word in words]
        streams = listen(session.probe, wanted, options.duration)
        found = discover(session.probe, session.robot)
        add_publishers(streams, found, wanted)
        add_readers(streams, found, session.probe)
    if not streams:
        raise RobotError(f"no active key on {', '.join(wanted)}; try `t2 doctor`")
    warn_if_closed(found)
    rows = [as_json(key, streams[key], session.robot) for key in sorted(streams)]
    output.rows(rows, HEAD, as_cells, options.output)
    return 0


def listen(probe: Probe, wanted: list[str], seconds: float) -> dict[str, Stream]:
    """Return the streams that arrive on these keys."""
    streams: dict[str, Stream] = {}
    for each in wanted:
        probe.listen(each)
    with until_interrupt():
        for sample in probe.samples(seconds):
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


def add_readers(streams: dict[str, Stream], found: list[Member], probe: Probe) -> None:
    """Add the readers of each key."""
    for key, stream in streams.items():
        if chunks(key)[1].startswith(UNLISTED):
            stream.readers = {SOMEONE} if probe.has_reader(key) else set()
            continue
        for member in found:
            if any(intersects(key, read) for read in member.reads):
                stream.readers.add(title(member, found))


def list_services(session: BusSession, options: argparse.Namespace) -> int:
    """List the services; raise ``RobotError`` without any."""
    found = discover(session.probe, session.robot)
    if not found:
        raise RobotError("no service found; try `t2 doctor`")
    warn_if_closed(found)
    rows = [service_as_json(each, found, session.robot) for each in found]
    if wants_json(options):
        for row in rows:
            output.line(row)
    else:
        print(printable("\n\n".join(map(service_as_text, rows)), "\n"))
    return 0


def warn_if_closed(found: Sequence[Member]) -> None:
    """Warn if the router lists no declaration."""
    if not any(each.reads or each.publishes for each in found):
        output.warn(f"t2 ls: {CLOSED}")


def as_json(key: str, stream: Stream, robot: str) -> dict[str, Any]:
    """Return one stream as a JSON object."""
    topic = topic_of(key)
    return {
        "key": short(key, robot),
        "type": stream.kind,
        "hz": stream.stats.rate_hz(),
        "expected_hz": topic.rate_hz if topic else None,
        "publishers": sorted(stream.publishers),
        "readers": sorted(stream.readers),
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
        ", ".join(row["readers"]) or "-",
    ]


def service_as_json(member: Member, found: Sequence[Member], robot: str) -> dict[str, Any]:
    """Return one session as a JSON object."""
    declared = {
        "publishes": member.publishes, "reads": member.reads, "answers": member.answers,
    }  # fmt: skip
    return {
        "name": title(member, found),
        "robot": member.robot,
        "instance": member.instance,
        "session": member.zid,
        **{role: [short(key, robot) for key in sorted(each)] for role, each in declared.items()},
    }


def service_as_text(row: dict[str, Any]) -> str:
    """Return one session as lines; every service answers the keys info/."""
    kind = f"instance {row['instance']}" if row["instance"] else "session without a service"
    lines = [f"{row['name']}  ({kind})"]
    lines += [f"  publishes  {key}" for key in row["publishes"]]
    lines += [f"  reads      {key}" for key in row["reads"]]
    lines += [f"  answers    {key}" for key in row["answers"] if not key.startswith("info/")]
    return "\n".join(lines)
