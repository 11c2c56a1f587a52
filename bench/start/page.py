"""Blocks and targets of the document for the benchmark ``start``. Pure."""

from collections.abc import Sequence

from bench.series import Series
from bench.start.rows import BARE, BRIDGE, FIRST_STOP
from bench.target import Target, verdict_of
from verification.harness.results import table

FIGURES = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
ENOUGH = 100  # samples for a p99
STOP = BRIDGE, FIRST_STOP
LIMIT_MS = 250  # the first STOP, in the median


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    samples = min(len(each.samples_ns) for each in series)
    return {"table": start_table(series), "samples": f"{samples:,}"}


def targets(series: Sequence[Series]) -> list[Target]:
    """Return the target of the first STOP."""
    stop_ms = next(each.p50_ns for each in series if each.name == STOP) / 1e6
    name = ", ".join(STOP)
    return [Target(name, f"p50: {stop_ms:.0f} ms", f"{LIMIT_MS} ms", stop_ms / LIMIT_MS, 1.0)]


def start_table(series: Sequence[Series]) -> str:
    """Return a row for each process and event, the fastest first, times in ms."""
    (script,) = (each for each in series if each.name == BARE)
    lines, reached = [], targets(series)
    for one in sorted(series, key=lambda each: each.p50_ns):
        cells = {name: f"{one.percentile_ns(share) / 1e6:.0f}" for name, share in FIGURES.items()}
        if len(one.samples_ns) < ENOUGH:
            cells["p99"] = ""
        ratio = f"× {one.ratio(script):.1f}"
        lines.append([*one.name, *cells.values(), ratio, verdict_of(", ".join(one.name), reached)])
    return table(["started", "until", *FIGURES, "of the script's", "targets"], lines)
