"""``t2 report FILE...``: each recording as one page that needs nothing else to be read.

The path, speeds asked, allowed and measured, ranges, stops with their reasons, events, rates and
gaps of each stream, reaction times. Needs the extra ``report``.
"""

import argparse
from pathlib import Path

from cli.recordings.recorded import opened
from common.errors import RobotError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="recordings (.mcap)")
    parser.add_argument(
        "--out", type=Path, metavar="HTML", help="the page of one FILE; else beside it, as .html"
    )


def run(options: argparse.Namespace) -> int:
    """Write a page for each and name it; raise ``RobotError`` for the first that cannot be."""
    files: list[Path] = options.files
    if options.out and len(files) > 1:
        raise RobotError(f"--out names one page, and there are {len(files)} recordings")
    for file in files:
        print(written(file, options.out or file.with_suffix(".html")))
    return 0


def written(file: Path, out: Path) -> Path:
    """Write the page of one recording, and return where it is."""
    try:
        from cli.recordings.report.page import page, told
    except ImportError as error:
        raise RobotError(f"a report wants {error.name}: pip install -e '.[report]'") from None
    if out.exists() and file.exists() and out.samefile(file):
        raise RobotError(f"{out}: is the recording itself; name another page with --out")
    with opened(file) as reader:
        story = told(reader)
        if story.began_ns is None:
            raise RobotError(f"{file}: holds no message of the bus")
        text = page(story, reader)
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RobotError(f"{out}: cannot be written: {error.strerror}") from None
    return out
