"""Blocks of the document for the benchmark ``start``. Pure."""

from collections.abc import Sequence

from bench.series import Series
from bench.start.rows import BARE, BRIDGE, FIRST_STOP
from verification.harness.results import table

MEMORY = "memory"
FIGURES = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
ENOUGH = 100  # samples for a p99
TARGET_MS = 250  # the first STOP, in the median
TARGET_MB = 150  # all processes on board; what they share counts once
MB = 1_000_000


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    starts = [each for each in series if each.name[0] != MEMORY]
    held = {each.name[1]: each.note for each in series if each.name[0] == MEMORY}
    sizes = {name: (int(note.split()[0]), int(note.split()[1])) for name, note in held.items()}
    return {
        "table": start_table(starts),
        "memory": memory_table(sizes),
        "verdict": verdict(starts, sizes),
        "samples": f"{min(len(each.samples_ns) for each in starts):,}",
    }


def start_table(starts: Sequence[Series]) -> str:
    """Return a row for each process and event, the fastest first, times in ms."""
    (script,) = (each for each in starts if each.name == BARE)
    lines = []
    for one in sorted(starts, key=lambda each: each.p50_ns):
        cells = {name: f"{one.percentile_ns(share) / 1e6:.0f}" for name, share in FIGURES.items()}
        if len(one.samples_ns) < ENOUGH:
            cells["p99"] = ""
        lines.append([*one.name, *cells.values(), f"× {one.ratio(script):.1f}"])
    return table(["started", "until", *FIGURES, "of the script's"], lines)


def memory_table(sizes: dict[str, tuple[int, int]]) -> str:
    """Return a row for each process and one for all, in MB."""
    lines = []
    total = (sum(rss for rss, _ in sizes.values()), sum(pss for _, pss in sizes.values()))
    for name, (rss, pss) in (sizes | {"all": total}).items():
        lines.append([name, f"{rss / MB:.1f}", f"{pss / MB:.1f}"])
    return table(["process", "RSS", "PSS"], lines)


def verdict(starts: Sequence[Series], sizes: dict[str, tuple[int, int]]) -> str:
    """Return which targets are reached."""
    (stop,) = (each for each in starts if each.name == (BRIDGE, FIRST_STOP))
    stop_ms, pss_mb = stop.p50_ns / 1e6, sum(pss for _, pss in sizes.values()) / MB
    return "\n".join(
        f"- {what}: {value:.0f} of {limit} {unit}: {'reached' if value <= limit else 'not reached'}"
        for what, value, limit, unit in (
            ("T2's first STOP, p50", stop_ms, TARGET_MS, "ms"),
            ("memory of all on board, PSS", pss_mb, TARGET_MB, "MB"),
        )
    )
