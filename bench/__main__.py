"""``python -m bench``: T2 beside what a user would pick instead, as a document.

Raw samples are kept in ``out/bench``; parts that are not measured anew are told from there.
"""

import argparse
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from bench.command import part as command_part
from bench.growth import page as growth_page
from bench.growth import part as growth_part
from bench.growth import plot as growth_plot
from bench.load import page as load_page
from bench.load import part as load_part
from bench.load import plot as load_plot
from bench.path import page as path_page
from bench.reaction import page as reaction_page
from bench.reaction import part as reaction_part
from bench.reaction import plot as reaction_plot
from bench.series import RAW, Measured, Series, load, store
from bench.start import page as start_page
from bench.start import part as start_part
from bench.start import plot as start_plot
from bench.telemetry import page as telemetry_page
from bench.telemetry import part as telemetry_part
from common.freshness import NS_PER_S
from verification.harness.host import StallRecorder, description

PAGE = Path(__file__).with_name("page.md")
UNMEASURED = 3  # exit code where something to measure, or to tell, is not there


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the document: how it is measured, told and drawn."""

    measure: Callable[[], list[Series]]
    versions: Callable[[], str]
    blocks: Callable[[Sequence[Series]], dict[str, str]]
    draw: Callable[[Path, Sequence[Series]], None]


PARTS = {
    "reaction": Part(
        reaction_part.measure,
        reaction_part.versions,
        reaction_page.blocks,
        partial(reaction_plot.draw, what="contact to BREAK"),
    ),
    "start": Part(start_part.measure, start_part.versions, start_page.blocks, start_plot.draw),
    "command": Part(
        command_part.measure,
        command_part.versions,
        path_page.blocks,
        partial(reaction_plot.draw, what="request to frame"),
    ),
    "telemetry": Part(
        telemetry_part.measure,
        telemetry_part.versions,
        telemetry_page.blocks,
        partial(reaction_plot.draw, what="frame to consumer"),
    ),
    "load": Part(load_part.measure, load_part.versions, load_page.blocks, load_plot.draw),
    "growth": Part(growth_part.measure, growth_part.versions, growth_page.blocks, growth_plot.draw),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, keep, tell; return ``UNMEASURED`` where something for that is missing."""
    options = _arguments().parse_args(argv)
    for name in [] if options.again else options.only or PARTS:
        try:
            print(f"{name}: {store(name, measured(PARTS[name]))}", file=sys.stderr)
        except ModuleNotFoundError as error:
            print(f"{error.name} is not installed: say make bench", file=sys.stderr)
            return UNMEASURED
    kept = {name: load(name) for name in PARTS}
    missing = [name for name, one in kept.items() if one is None]
    if missing:
        print(f"no samples in {RAW} of {', '.join(missing)}: measure them first", file=sys.stderr)
        return UNMEASURED
    told = {name: one for name, one in kept.items() if one is not None}
    text = page(told)
    print(text)
    for name, one in told.items():
        PARTS[name].draw(RAW / f"{name}.png", one.series)
        if options.out:
            PARTS[name].draw(picture(options.out, name), one.series)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return 0


def measured(part: Part) -> Measured:
    """Measure a part, with a witness of what else the machine does."""
    versions = part.versions()
    with StallRecorder() as holdups:
        begin_ns = time.monotonic_ns()
        series = part.measure()
        seconds = (time.monotonic_ns() - begin_ns) / NS_PER_S
        held_ms = 1000 * holdups.worst_s(begin_ns, seconds)
    return Measured(
        where=f"{datetime.now(UTC):%Y-%m-%d}: {description()}, Python {platform.python_version()}; "
        f"{versions}; {seconds / 60:.0f} minutes",
        noise=f"A process that only sleeps was held up for {held_ms:.0f} ms at worst",
        series=series,
    )


def page(told: dict[str, Measured]) -> str:
    """Return the document; a part's blocks have its name in front."""
    blocks: dict[str, str] = {}
    for name, one in told.items():
        own = PARTS[name].blocks(one.series) | {"where": one.where, "noise": one.noise}
        blocks |= {f"{name}_{block}": text for block, text in own.items()}
    return PAGE.read_text(encoding="utf-8").format(**blocks)


def picture(out: Path, name: str) -> Path:
    """Return where the picture of a part goes, beside the document."""
    return out.parent / "images" / f"performance-{name}.png"


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument(
        "--only", action="append", choices=PARTS, metavar="PART",
        help=f"measure this anew: {', '.join(PARTS)}; repeatable",
    )  # fmt: skip
    parser.add_argument("--again", action="store_true", help="tell what was measured last")
    parser.add_argument("--out", type=Path, metavar="FILE", help="where the document goes")
    return parser


if __name__ == "__main__":
    sys.exit(main())
