"""``python -m bench``: benchmarks of T2 and its alternatives, as a document.

Raw samples are stored in ``out/bench``. A benchmark that is not measured again is read from there.
"""

import argparse
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from bench.command import measure as command_measure
from bench.growth import measure as growth_measure
from bench.growth import page as growth_page
from bench.load import measure as load_measure
from bench.load import page as load_page
from bench.path import page as path_page
from bench.reaction import measure as reaction_measure
from bench.reaction import page as reaction_page
from bench.reaction import plot as reaction_plot
from bench.series import RAW, Measured, Series, load, store
from bench.start import measure as start_measure
from bench.start import page as start_page
from bench.target import Target, summary
from bench.telemetry import measure as telemetry_measure
from bench.telemetry import page as telemetry_page
from common import clock
from common.freshness import NS_PER_S
from verification.harness.host import StallRecorder, description

PAGE = Path(__file__).with_name("page.md")
UNMEASURED = 3  # exit code when packages or samples are missing


Questions = Mapping[str, Callable[[Sequence[Series]], list[Target]]]


@dataclass(frozen=True, slots=True)
class Benchmark:
    """One or more sections of the document: measurement, blocks, targets by question, plot."""

    measure: Callable[[], list[Series]]
    versions: Callable[[], str]
    blocks: Callable[[Sequence[Series]], dict[str, str]]
    questions: Questions
    draw: Callable[[Path, Sequence[Series]], None] | None = None


BENCHMARKS = {
    "reaction": Benchmark(
        reaction_measure.measure,
        reaction_measure.versions,
        reaction_page.blocks,
        {"How soon after a contact does the vehicle brake?": reaction_page.targets},
        reaction_plot.draw,
    ),
    "command": Benchmark(
        command_measure.measure,
        command_measure.versions,
        path_page.blocks,
        {"How soon does a request reach the wheels?": path_page.targets},
    ),
    "telemetry": Benchmark(
        telemetry_measure.measure,
        telemetry_measure.versions,
        telemetry_page.blocks,
        {
            "How soon does a consumer have a sample?": telemetry_page.targets,
            "How old are the samples that safety decides on?": telemetry_page.age_targets,
        },
    ),
    "load": Benchmark(
        load_measure.measure,
        load_measure.versions,
        load_page.blocks,
        {
            "How many frames and consumers does the bridge serve?": load_page.throughput_targets,
            "What does the stack cost on board?": load_page.cost_targets,
        },
    ),
    "start": Benchmark(
        start_measure.measure,
        start_measure.versions,
        start_page.blocks,
        {"How soon after the start is the first STOP sent?": start_page.targets},
    ),
    "growth": Benchmark(
        growth_measure.measure,
        growth_measure.versions,
        growth_page.blocks,
        {
            "Does the cost grow faster than the number of consumers or bytes?": (
                growth_page.targets
            ),
        },
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
        draw = BENCHMARKS[name].draw
        if draw:
            draw(plot_file(options.out, name) if options.out else RAW / f"{name}.png", one.series)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return 0


def measured(benchmark: Benchmark) -> Measured:
    """Measure, and record the stalls of the host meanwhile."""
    versions = benchmark.versions()
    with StallRecorder() as stalls:
        begin_ns = clock.now_ns()
        series = benchmark.measure()
        seconds = (clock.now_ns() - begin_ns) / NS_PER_S
        stall_ms = 1000 * stalls.worst_s(begin_ns, seconds)
    return Measured(
        where=f"{datetime.now(UTC):%Y-%m-%d}: {description()}, Python {platform.python_version()}; "
        f"{versions}; {seconds / 60:.0f} minutes",
        noise=f"A sleeping process was stalled for at most {stall_ms:.0f} ms",
        series=series,
    )


def page(results: dict[str, Measured]) -> str:
    """Return the document; the name of a benchmark prefixes its blocks."""
    blocks: dict[str, str] = {"summary": summary(answers(results))}
    for name, one in results.items():
        own = BENCHMARKS[name].blocks(one.series) | {"where": one.where, "noise": one.noise}
        blocks |= {f"{name}_{block}": text for block, text in own.items()}
    return PAGE.read_text(encoding="utf-8").format(**blocks)


def answers(results: Mapping[str, Measured]) -> list[tuple[str, list[Target]]]:
    """Return the targets by question, in the order of the document."""
    return [
        (question, targets(results[name].series))
        for name, benchmark in BENCHMARKS.items()
        for question, targets in benchmark.questions.items()
    ]


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
