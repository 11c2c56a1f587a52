"""``python -m bench``: benchmarks of T2 and its alternatives, as a document."""

import argparse
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from bench import fleet, link, load, reaction
from bench.figures import Column, Figures, Limits, columns, compared
from bench.processes import MissingError
from bench.reaction import PACKAGE, is_granted
from verification.harness.host import description
from verification.harness.results import filled, table

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
HEAD = ["question", "figure", "compared with", "ratio", "target", "verdict"]


class Result(NamedTuple):
    """The result of one benchmark."""

    where: str  # date, machine, versions, and what was left out
    figures: Figures


class Benchmark(NamedTuple):
    """A section of the document: question, measurement, table and limits."""

    question: str
    measure: Callable[[], Figures]
    heads: Sequence[str]
    columns: Sequence[Column]
    limits: Limits


BENCHMARKS: Mapping[str, Benchmark] = {
    "reflex": Benchmark(
        "How soon after a contact does the bridge brake?",
        partial(reaction.measured, reaction.REFLEX_ROWS),
        ["row", "load"], reaction.columns(reaction.LOOP), reaction.LIMITS,
    ),
    "stop": Benchmark(
        "How soon does safety's decision brake?",
        partial(reaction.measured, reaction.STOP_ROWS),
        ["row", "load"], reaction.columns(reaction.ZENOH), reaction.LIMITS,
    ),
    "cpu": Benchmark(
        "What does the chain cost on board?",
        load.cpu, ["", "process"], load.CPU_COLUMNS, load.CPU_LIMITS,
    ),
    "functions": Benchmark(
        "How long does safety decide?",
        load.functions, ["", "function"], load.FUNCTION_COLUMNS, load.FUNCTION_LIMITS,
    ),
    "consumers": Benchmark(
        "What do consumers on board cost?",
        load.consumers, ["consumers"], load.CONSUMER_COLUMNS, load.CONSUMER_LIMITS,
    ),
    "fleet": Benchmark(
        "What do robots cost a site's router?",
        fleet.measure, ["robots", "subscribed"], fleet.COLUMNS, fleet.LIMITS,
    ),
    "link": Benchmark(
        "What does a bad link do?", link.measure, ["link"], link.COLUMNS, link.LIMITS
    ),
}  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and print the document; without ``--only`` it can be written to a file."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--only", action="append", choices=BENCHMARKS, metavar="NAME",
        help=f"measure only this: {', '.join(BENCHMARKS)}; repeatable",
    )  # fmt: skip
    where.add_argument("--out", type=Path, metavar="FILE", help="write the document here")
    options = parser.parse_args(argv)
    found = dict.fromkeys(BENCHMARKS, Result("nothing: not measured", {}))
    for name in options.only or BENCHMARKS:
        print(name, file=sys.stderr, flush=True)
        found[name] = measured(BENCHMARKS[name])
    text = page(found)
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return 0


def measured(benchmark: Benchmark) -> Result:
    """Measure, and say where."""
    dds = version(PACKAGE) if find_spec(PACKAGE) else "not installed, its row is left out"
    granted = "granted" if is_granted() else "not granted"
    begin_s, left_out = time.monotonic(), ""
    made: Figures = {}
    try:
        made = benchmark.measure()
    except MissingError as error:
        left_out = f"not measured: {error}"
    where = [
        f"{datetime.now(UTC):%Y-%m-%d}: {description()}, Python {platform.python_version()}",
        f"eclipse-zenoh {version('eclipse-zenoh')}; {PACKAGE} {dds}; SCHED_FIFO {granted}",
        f"{time.monotonic() - begin_s:.0f} s",
        left_out,
    ]  # fmt: skip
    return Result("; ".join(filter(None, where)), made)


def page(results: Mapping[str, Result]) -> str:
    """Return the document with its generated blocks replaced."""
    blocks, rows = dict[str, str](), list[list[str]]()
    for name, one in results.items():
        it = BENCHMARKS[name]
        figures = columns(it.heads, it.columns, one.figures)
        blocks[name] = f"Measured on {one.where}.\n\n{figures}"
        rows += compared(it.question, it.limits, one.figures)
    blocks["summary"] = table(HEAD, rows)
    return filled(PAGE.read_text(encoding="utf-8"), blocks)


if __name__ == "__main__":
    sys.exit(main())
