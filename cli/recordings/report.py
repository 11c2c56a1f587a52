"""``t2 report FILE...``: an HTML report of each recording, in one self-contained file.

It shows the stops with their reasons, the pictures around each latch, the events with their
authors, the velocities (requested, allowed, measured), the path, also in the map, and rates and
gaps of each stream. All content from the bus is escaped. It needs the extra ``report``.
"""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cli.inspect.addressing import chunks
from cli.page import fill_page
from cli.recordings.info import clock, open_recording, said, summary, timeline_of, warnings
from cli.recordings.timeline import Timeline
from common.cli_args import file_path, needs_extra, reader_language
from common.text import printable
from t2.errors import T2Error
from t2.words import Language

if TYPE_CHECKING:
    from services.recorder.reader import Reader


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "files", type=file_path, nargs="+", metavar="FILE", help="recordings (.mcap)"
    )
    parser.add_argument(
        "--out",
        type=file_path,
        metavar="HTML",
        help="output file, for one FILE; by default FILE with the suffix .html",
    )


def run(options: argparse.Namespace) -> int:
    """Write a report for each file and print its path; raise ``T2Error`` on the first error."""
    files: list[Path] = options.files
    language = reader_language()
    if options.out and len(files) > 1:
        raise T2Error(f"--out is for one recording, and there are {len(files)} recordings")
    for file in files:
        out = options.out or file.with_suffix(".html")
        write_report(file, out, language)
        print(out)
    return 0


def write_report(file: Path, out: Path, language: Language = "en") -> None:
    """Write the report of one recording."""
    if out.exists() and file.exists() and out.samefile(file):
        raise T2Error(f"{out}: is the recording itself; choose another file with --out")
    with open_recording(file) as reader:
        timeline = timeline_of(reader)
        if timeline.began_ns is None:
            raise T2Error(f"{file}: contains no messages of the bus")
        text = printable(page(timeline, reader, language), "\n")
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise T2Error(f"{out}: cannot be written: {error.strerror}") from None


def page(timeline: Timeline, reader: "Reader", language: Language = "en") -> str:
    """Return the page of a recording that has been read to its end."""
    with needs_extra("report", "a report"):
        from cli.recordings import figures
    # The fastest streams first, event-driven keys last.
    streams = sorted(timeline.streams.values(), key=lambda each: (-each.expected_hz, each.key))
    names = [chunks(stream.key)[1] or stream.key for stream in streams]
    return fill_page(
        "recordings/report.html",
        {"clock": clock, "said": partial(said, language=language)},
        timeline=timeline,
        title=reader.path.name,
        about=summary(timeline, reader),
        warnings=warnings(timeline, reader),
        streams=list(zip(names, streams, strict=True)),
        latches=[latch for latch in timeline.pictures.latches if latch.pictures],
        path=figures.path(timeline) if timeline.path else "",
        map_path=figures.map_path(timeline) if timeline.map.path else "",
        speeds=figures.speeds(timeline),
    )
