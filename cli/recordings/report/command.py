"""``t2 report FILE...``: an HTML report of each recording, in one self-contained file.

It shows the path, the velocities (requested, allowed, measured), sonar ranges, stops with their
reasons, events, rates and gaps of each stream. It needs the extra ``report``.
"""

import argparse
from pathlib import Path

from cli.recordings.info import open_recording
from common.errors import RobotError
from common.text import printable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="recordings (.mcap)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="HTML",
        help="output file, for one FILE; by default FILE with the suffix .html",
    )


def run(options: argparse.Namespace) -> int:
    """Write a report for each file and print its path; raise ``RobotError`` on the first error."""
    files: list[Path] = options.files
    if options.out and len(files) > 1:
        raise RobotError(f"--out is for one recording, and there are {len(files)} recordings")
    for file in files:
        print(write_report(file, options.out or file.with_suffix(".html")))
    return 0


def write_report(file: Path, out: Path) -> Path:
    """Write the report of one recording, and return its path."""
    try:
        from cli.recordings.report.page import page, timeline_of
    except ImportError as error:
        raise RobotError(f"a report needs {error.name}: pip install -e '.[report]'") from None
    if out.exists() and file.exists() and out.samefile(file):
        raise RobotError(f"{out}: is the recording itself; choose another file with --out")
    with open_recording(file) as reader:
        timeline = timeline_of(reader)
        if timeline.began_ns is None:
            raise RobotError(f"{file}: contains no messages of the bus")
        text = printable(page(timeline, reader), "\n")
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RobotError(f"{out}: cannot be written: {error.strerror}") from None
    return out
