"""``t2 info``: the content of a recording."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.inspect import output
from cli.inspect.session import add_output, wants_json
from common.errors import RobotError
from common.freshness import NS_PER_S
from common.keys import ROOT
from common.text import printable
from services.recorder.summary import Note, Summary

if TYPE_CHECKING:
    from services.recorder.reader import Reader


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", metavar="FILE", type=Path, nargs="+")
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Show each file; return 1 if any is truncated or damaged."""
    complete = True
    for number, file in enumerate(options.files):
        reader, summary = summarize(file)
        complete = complete and not (reader.cut or reader.damaged)
        if wants_json(options):
            output.line(as_json(reader, summary))
        else:
            print(*([""] if number else []), printable(as_text(reader, summary), "\n"), sep="\n")
    return 0 if complete else 1


def open_recording(path: Path) -> "Reader":
    """Open a recording; raise ``RobotError`` if it cannot be read or the library is missing."""
    try:
        from services.recorder.reader import Reader
    except ModuleNotFoundError as error:
        raise RobotError(
            f"recordings need {error.name}: install the extra `record` (pip install -e '.[record]')"
        ) from None
    return Reader(path)


def summarize(file: Path) -> tuple["Reader", Summary]:
    """Return the summary of a recording; raise ``RobotError`` if it is not a recording."""
    summary = Summary()
    with open_recording(file) as reader:
        for each in reader:
            raw = each.sample.raw is not None
            summary.add(each.key, each.kind, each.message, each.log_ns, raw=raw)
    return reader, summary


def as_json(reader: "Reader", summary: Summary) -> dict[str, Any]:
    """Return the summary as JSON fields."""
    return {
        "file": str(reader.path),
        "bytes": reader.size,
        "readable": reader.readable,
        "cut": reader.cut,
        "damaged_chunks": reader.damaged,
        "about": reader.about,
        "begin_ns": summary.begin_ns,
        "duration": round(summary.duration_s, 3),
        "messages": summary.messages,
        "versions": summary.versions,
        "keys": {
            key: {"type": one.kind, "count": one.count, "hz": one.hz, "raw": one.raw,
                  "faulty": summary.faulty[key]}
            for key, one in sorted(summary.streams.items())
        },
        "events": [_as_json(note) for note in summary.events],
        "latched": [_as_json(note) for note in summary.latched],
    }  # fmt: skip


def as_text(reader: "Reader", summary: Summary) -> str:
    """Return the summary as text."""
    about = dict(reader.about)
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime((summary.begin_ns or 0) / NS_PER_S))
    state = f"truncated, {reader.readable} bytes are readable" if reader.cut else "complete"
    if reader.damaged:
        state += f", {reader.damaged} damaged chunks skipped"
    lines = [
        f"{reader.path}: {reader.size} bytes, {state}",
        f"robot {about.get('robot', '?')}, recorded by T2 {about.get('version', '?')}, "
        f"reason: {about.get('why', '?')}",
        f"{summary.messages} messages in {summary.duration_s:.1f} s, from {began}"
        if summary.messages
        else "no messages",
    ]
    if summary.versions:
        versions = (f"{name} {version}" for name, version in sorted(summary.versions.items()))
        lines.append(f"versions: {', '.join(versions)}")
    rows = [
        [
            key.removeprefix(f"{ROOT}/"),
            one.kind,
            str(one.count),
            "-" if one.hz is None else f"{one.hz:.1f}",
        ]
        for key, one in sorted(summary.streams.items())
    ]
    lines += ["", output.table(["key", "type", "messages", "Hz"], rows)]
    for title, notes in (("latched", summary.latched), ("events", summary.events)):
        if notes:
            lines += ["", f"{title}:", *(_as_text(note) for note in notes)]
    return "\n".join(lines)


def _as_json(note: Note) -> dict[str, Any]:
    return {"at": round(note.at_s, 3), "who": note.service, "level": note.level, "text": note.text}


def _as_text(note: Note) -> str:
    return f"{note.at_s:8.2f} s  {note.level:7}  {note.service}: {printable(note.text)}"
