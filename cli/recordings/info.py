"""``t2 info``: what is in a recording."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.inspect import output
from cli.inspect.shell import add_output, wants_json
from cli.recordings.recorded import opened
from common.freshness import NS_PER_S
from common.keys import ROOT

if TYPE_CHECKING:
    from services.recorder.reader import Reader
    from services.recorder.summary import Note, Summary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", metavar="FILE", type=Path, nargs="+")
    add_output(parser)


def run(options: argparse.Namespace) -> int:
    """Show them, one after the other; 1 when some of it cannot be read."""
    whole = True
    for number, file in enumerate(options.files):
        reader, summary = read(file)
        whole = whole and not (reader.cut or reader.damaged)
        if wants_json(options):
            output.line(as_json(reader, summary))
        else:
            print(*([""] if number else []), as_text(reader, summary), sep="\n")
    return 0 if whole else 1


def read(file: Path) -> tuple["Reader", "Summary"]:
    """Return what a recording holds; raise ``RobotError`` when it is none."""
    from services.recorder.summary import Summary

    summary = Summary()
    with opened(file) as reader:
        for each in reader:
            raw = each.sample.raw is not None
            summary.take(each.key, each.kind, each.message, each.log_ns, raw=raw)
    return reader, summary


def as_json(reader: "Reader", summary: "Summary") -> dict[str, Any]:
    """Return it for programs."""
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


def as_text(reader: "Reader", summary: "Summary") -> str:
    """Return it for people."""
    about = dict(reader.about)
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime((summary.begin_ns or 0) / NS_PER_S))
    state = f"cut short, {reader.readable} bytes can be read" if reader.cut else "whole"
    if reader.damaged:
        state += f", {reader.damaged} chunks are damaged and left out"
    lines = [
        f"{reader.path}: {reader.size} bytes, {state}",
        f"robot {about.get('robot', '?')}, recorded by T2 {about.get('version', '?')}, "
        f"because of: {about.get('why', '?')}",
        f"{summary.messages} messages in {summary.duration_s:.1f} s, from {began}"
        if summary.messages
        else "no messages",
    ]
    if summary.versions:
        told = ", ".join(f"{name} {version}" for name, version in sorted(summary.versions.items()))
        lines.append(f"versions: {told}")
    rows = [
        [_short(key), one.kind, str(one.count), "-" if one.hz is None else f"{one.hz:.1f}"]
        for key, one in sorted(summary.streams.items())
    ]
    lines += ["", output.table(["key", "type", "messages", "Hz"], rows)]
    for title, notes in (("latched", summary.latched), ("events", summary.events)):
        if notes:
            lines += ["", f"{title}:", *(_as_text(note) for note in notes)]
    return "\n".join(lines)


def _short(key: str) -> str:
    return key.removeprefix(f"{ROOT}/")


def _as_json(note: "Note") -> dict[str, Any]:
    return {"at": round(note.at_s, 3), "who": note.who, "level": note.level, "text": note.text}


def _as_text(note: "Note") -> str:
    return f"{note.at_s:8.2f} s  {note.level:7}  {note.who}: {note.text}"
