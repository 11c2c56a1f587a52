"""``t2 info``: the content of a recording."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from cli.inspect import output
from cli.recordings.timeline import Timeline
from common.cli_args import needs_extra
from common.freshness import NS_PER_S
from common.keys import ROOT
from common.text import printable

if TYPE_CHECKING:
    from services.recorder.reader import Reader


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", metavar="FILE", type=Path, nargs="+")


def run(options: argparse.Namespace) -> int:
    """Show each file; return 1 if any is truncated or damaged."""
    complete = True
    for number, file in enumerate(options.files):
        with open_recording(file) as reader:
            timeline = timeline_of(reader)
        complete = complete and not (reader.cut or reader.damaged)
        print(*([""] if number else []), printable(as_text(reader, timeline), "\n"), sep="\n")
    return 0 if complete else 1


def open_recording(path: Path) -> "Reader":
    """Open a recording; raise ``RobotError`` if it cannot be read or the library is missing."""
    with needs_extra("record", "a recording"):
        from services.recorder.reader import Reader
    return Reader(path)


def timeline_of(reader: "Reader") -> Timeline:
    """Return the timeline of a recording; raise ``RobotError`` if it is not a recording."""
    timeline = Timeline()
    for each in reader:
        timeline.add(each.key, each.kind, each.message, each.log_ns)
    return timeline


def as_text(reader: "Reader", timeline: Timeline) -> str:
    """Return the summary as text."""
    lines = [_file(reader), _source(reader), _span(timeline)]
    if timeline.versions:
        versions = (f"{name} {version}" for name, version in sorted(timeline.versions.items()))
        lines.append(f"versions: {', '.join(versions)}")
    rows = [
        [
            key.removeprefix(f"{ROOT}/"),
            one.kind,
            str(len(one.times)),
            "-" if one.hz is None else f"{one.hz:.1f}",
            str(one.lost),
        ]
        for key, one in sorted(timeline.streams.items())
    ]
    lines += ["", output.table(["key", "type", "messages", "Hz", "lost"], rows)]
    stops = [
        f"{stop.begins_s:8.2f} s  {stop.verdict:9}  for {stop.lasts_s:.1f} s: "
        + " ".join(f"{name}: {printable(text)}" for name, text in stop.reasons.items())
        for stop in timeline.stops
    ]
    events = [
        f"{each.at_s:8.2f} s  {each.event.level:9}  {each.service}: {each.event.name}: "
        f"{printable(each.event.text)}"
        for each in timeline.events
    ]
    for title, texts in (("stops", stops), ("events", events)):
        if texts:
            lines += ["", f"{title}:", *texts]
    return "\n".join(lines)


def _file(reader: "Reader") -> str:
    state = f"truncated, {reader.readable} bytes are readable" if reader.cut else "complete"
    if reader.damaged:
        state += f", {reader.damaged} damaged chunks skipped"
    return f"{reader.path}: {reader.size} bytes, {state}"


def _source(reader: "Reader") -> str:
    robot, version, why = (reader.about.get(name, "?") for name in ("robot", "version", "why"))
    return f"robot {robot}, recorded by T2 {version}, reason: {why}"


def _span(timeline: Timeline) -> str:
    if timeline.began_ns is None:
        return "no messages"
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(timeline.began_ns / NS_PER_S))
    return f"{timeline.messages} messages in {timeline.lasted_s:.1f} s, from {began}"
