"""``python -m bench``: benchmarks of T2 and its alternatives, as a document.

Raw samples are stored in ``out/bench``. A benchmark that is not measured again is read from there.
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

from bench.command import measure as command_measure
from bench.growth import measure as growth_measure
from bench.growth import page as growth_page
from bench.growth import plot as growth_plot
from bench.load import measure as load_measure
from bench.load import page as load_page
from bench.load import plot as load_plot
from bench.path import page as path_page
from bench.reaction import measure as reaction_measure
from bench.reaction import page as reaction_page
from bench.reaction import plot as reaction_plot
from bench.series import RAW, Measured, Series, load, store
from bench.start import measure as start_measure
from bench.start import page as start_page
from bench.start import plot as start_plot
from bench.telemetry import measure as telemetry_measure
from bench.telemetry import page as telemetry_page
from common.freshness import NS_PER_S
from verification.harness.host import StallRecorder, description

PAGE = Path(__file__).with_name("page.md")
UNMEASURED = 3  # exit code when packages or samples are missing


@dataclass(frozen=True, slots=True)
class Benchmark:
    """One section of the document: measurement, blocks and plot."""

    measure: Callable[[], list[Series]]
    versions: Callable[[], str]
    blocks: Callable[[Sequence[Series]], dict[str, str]]
    draw: Callable[[Path, Sequence[Series]], None]


BENCHMARKS = {
    "reaction": Benchmark(
        reaction_measure.measure,
        reaction_measure.versions,
        reaction_page.blocks,
        partial(reaction_plot.draw, what="contact to BRAKE"),
    ),
    "start": Benchmark(
        start_measure.measure, start_measure.versions, start_page.blocks, start_plot.draw
    ),
    "command": Benchmark(
        command_measure.measure,
        command_measure.versions,
        path_page.blocks,
        partial(reaction_plot.draw, what="request to frame"),
    ),
    "telemetry": Benchmark(
        telemetry_measure.measure,
        telemetry_measure.versions,
        telemetry_page.blocks,
        partial(reaction_plot.draw, what="frame to consumer"),
    ),
    "load": Benchmark(
        load_measure.measure, load_measure.versions, load_page.blocks, load_plot.draw
    ),
    "growth": Benchmark(
        growth_measure.measure, growth_measure.versions, growth_page.blocks, growth_plot.draw
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, store, print; return ``UNMEASURED`` when something is missing."""
    options = _arguments().parse_args(argv)
    for name in [] if options.again else options.only or BENCHMARKS:
        try:
            print(f"{name}: {store(name, measured(BENCHMARKS[name]))}", file=sys.stderr)
        except ModuleNotFoundError as error:
            print(f"{error.name} is not installed; run make bench", file=sys.stderr)
            return UNMEASURED
    stored = {name: load(name) for name in BENCHMARKS}
    missing = [name for name, one in stored.items() if one is None]
    if missing:
        print(f"no samples in {RAW} of {', '.join(missing)}: measure them first", file=sys.stderr)
        return UNMEASURED
    found = {name: one for name, one in stored.items() if one is not None}
    text = page(found)
    print(text)
    for name, one in found.items():
        BENCHMARKS[name].draw(RAW / f"{name}.png", one.series)
        if options.out:
            BENCHMARKS[name].draw(plot_file(options.out, name), one.series)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return 0


def measured(benchmark: Benchmark) -> Measured:
    """Measure, and record the stalls of the host meanwhile."""
    versions = benchmark.versions()
    with StallRecorder() as stalls:
        begin_ns = time.monotonic_ns()
        series = benchmark.measure()
        seconds = (time.monotonic_ns() - begin_ns) / NS_PER_S
        stall_ms = 1000 * stalls.worst_s(begin_ns, seconds)
    return Measured(
        where=f"{datetime.now(UTC):%Y-%m-%d}: {description()}, Python {platform.python_version()}; "
        f"{versions}; {seconds / 60:.0f} minutes",
        noise=f"A sleeping process was stalled for at most {stall_ms:.0f} ms",
        series=series,
    )


def page(results: dict[str, Measured]) -> str:
    """Return the document; the name of a benchmark prefixes its blocks."""
    blocks: dict[str, str] = {}
    for name, one in results.items():
        own = BENCHMARKS[name].blocks(one.series) | {"where": one.where, "noise": one.noise}
        blocks |= {f"{name}_{block}": text for block, text in own.items()}
    return PAGE.read_text(encoding="utf-8").format(**blocks)


def plot_file(out: Path, name: str) -> Path:
    """Return the file of a plot, beside the document."""
    return out.parent / "images" / f"performance-{name}.png"


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument(
        "--only", action="append", choices=BENCHMARKS, metavar="NAME",
        help=f"measure only this: {', '.join(BENCHMARKS)}; repeatable",
    )  # fmt: skip
    parser.add_argument("--again", action="store_true", help="use the stored samples")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the document here")
    return parser


if __name__ == "__main__":
    sys.exit(main())
