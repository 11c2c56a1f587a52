"""``t2 info``: the content of a recording."""

import argparse
import shlex
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.recordings.timeline import Timeline
from common.cli_args import file_path, needs_extra, reader_language
from common.freshness import NS_PER_S
from common.text import printable
from t2.keys import ROOT
from t2.messages import Cause, Event, MapState
from t2.words import Language, render

if TYPE_CHECKING:
    from services.recorder.reader import Reader


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", metavar="FILE", type=file_path, nargs="+")


def run(options: argparse.Namespace) -> int:
    """Show each file; return 1 if any is truncated or damaged."""
    complete, language = True, reader_language()
    for number, file in enumerate(options.files):
        with open_recording(file) as reader:
            timeline = timeline_of(reader)
        complete = complete and not (reader.cut or reader.damaged)
        print(
            *([""] if number else []),
            printable(as_text(reader, timeline, language), "\n"),
            sep="\n",
        )
    return 0 if complete else 1


def open_recording(path: Path) -> "Reader":
    """Open a recording; raise ``T2Error`` if it cannot be read or the library is missing."""
    with needs_extra("record", "a recording"):
        from services.recorder.reader import Reader
    return Reader(path)


def timeline_of(reader: "Reader") -> Timeline:
    """Return the timeline of a recording; raise ``T2Error`` if it is not a recording."""
    timeline = Timeline()
    for each in reader:
        timeline.add(each.key, each.kind, each.message, each.log_ns)
    return timeline


def as_text(reader: "Reader", timeline: Timeline, language: Language = "en") -> str:
    """Return the summary, streams, stops and events as text."""
    about = summary(timeline, reader).items()
    lines = [f"{name}: {value}" for name, value in about if value]
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
    lines += [*warnings(timeline, reader), ""]
    lines.append(output.table(["key", "type", "messages", "Hz", "lost"], rows))
    stops = [
        f"{moment(timeline, stop.begins_s)}  {stop.verdict:9}  for {stop.lasts_s:.1f} s: "
        + " ".join(
            f"{name}: {printable(said(cause, language))}" for name, cause in stop.reasons.items()
        )
        for stop in timeline.stops
    ]
    events = [
        f"{moment(timeline, each.at_s)}  {each.event.level:9}  {each.service}: {each.event.name}: "
        f"{printable(said(each.event, language))}"
        for each in timeline.events
    ]
    for title, texts in (("stops", stops), ("events", events)):
        if texts:
            lines += ["", f"{title} (since the start, and UTC):", *texts]
    return "\n".join(lines)


def said(message: Cause | Event, language: Language) -> str:
    """Return the text of a cause or an event."""
    return render(message.phrases, language, message.text)


def summary(timeline: Timeline, reader: "Reader") -> dict[str, str]:
    """Return what a recording is, by name."""
    began = datetime.fromtimestamp((timeline.began_ns or 0) / NS_PER_S, UTC)
    robots = sorted({robot for key in timeline.streams if (robot := chunks(key)[0])})
    versions = ", ".join(f"{name} {version}" for name, version in sorted(timeline.versions.items()))
    while_driving = sum(stop.was_driving for stop in timeline.stops)
    return {
        "file": f"{shlex.quote(str(reader.path))}, {reader.size} bytes",
        "robot": ", ".join(robots),
        "start": f"{began:%Y-%m-%d %H:%M:%S} UTC" if timeline.streams else "",
        "duration": clock(timeline.lasted_s),
        "distance": f"{timeline.distance:.1f} m",
        "in the map": in_map(timeline),
        "stops": f"{len(timeline.stops)}, {while_driving} while driving",
        "services": versions or "no health messages",
        "messages": f"{timeline.messages} on {len(timeline.streams)} keys",
    }


def in_map(timeline: Timeline) -> str:
    """Return the times of each state of localization, and the number of fixes; empty without."""
    track, states = timeline.map, get_args(MapState)
    parts = [f"{state} {clock(track.lasted_s(state))}" for state in states if track.lasted_s(state)]
    used = sum(each.used for each in track.fixes)
    if track.fixes:
        parts.append(f"fixes: {used} used, {len(track.fixes) - used} refused")
    return ", ".join(parts)


def warnings(timeline: Timeline, reader: "Reader") -> list[str]:
    """Return warnings about an incomplete recording."""
    found = []
    if reader.cut:
        found.append("The file is truncated: its writer was killed, or is still writing.")
    if reader.damaged:
        found.append(f"{reader.damaged} damaged chunks of the file are skipped.")
    undecoded = sum(stream.undecoded for stream in timeline.streams.values())
    if undecoded:
        found.append(f"{undecoded} messages could not be decoded.")
    return found


def moment(timeline: Timeline, at_s: float) -> str:
    """Format a moment as seconds since the start, and UTC."""
    return f"{at_s:8.2f} s  {timeline.utc(at_s)}"


def clock(seconds: float) -> str:
    """Format a time or a duration."""
    minutes, tenths = divmod(round(10 * seconds), 600)
    return f"{minutes} min {tenths / 10:04.1f} s" if minutes else f"{tenths / 10:.1f} s"
