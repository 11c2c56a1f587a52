"""What the part ``start`` says in the document. Pure."""

from collections.abc import Sequence

from bench.series import Series
from bench.start.rows import BARE, BRIDGE, FIRST_STOP

MEMORY = "memory"
FIGURES = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
ENOUGH = 100  # samples for a p99
TO_REACH_MS = 250  # the first STOP, in the median
TO_REACH_MB = 150  # all processes on board; what they share counts once
MB = 1_000_000


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks of the document by their names."""
    starts = [each for each in series if each.name[0] != MEMORY]
    held = {each.name[1]: each.note for each in series if each.name[0] == MEMORY}
    sizes = {name: (int(note.split()[0]), int(note.split()[1])) for name, note in held.items()}
    return {
        "table": table(starts),
        "memory": memory(sizes),
        "verdict": verdict(starts, sizes),
        "samples": f"{min(len(each.samples_ns) for each in starts):,}",
    }


def table(starts: Sequence[Series]) -> str:
    """Return a row for each process and what is waited for, the soonest first, times in ms."""
    (script,) = (each for each in starts if each.name == BARE)
    lines = [["started", "until", *FIGURES, "of the script's"], ["---"] * 6]
    for one in sorted(starts, key=lambda each: each.p50_ns):
        told = {name: f"{one.percentile_ns(share) / 1e6:.0f}" for name, share in FIGURES.items()}
        if len(one.samples_ns) < ENOUGH:
            told["p99"] = ""
        lines.append([*one.name, *told.values(), f"× {one.ratio(script):.1f}"])
    return _rows(lines)


def memory(sizes: dict[str, tuple[int, int]]) -> str:
    """Return a row for each process and one for all, in MB."""
    lines = [["process", "RSS", "PSS"], ["---"] * 3]
    everybody = (sum(rss for rss, _ in sizes.values()), sum(pss for _, pss in sizes.values()))
    for name, (rss, pss) in (sizes | {"all": everybody}).items():
        lines.append([name, f"{rss / MB:.1f}", f"{pss / MB:.1f}"])
    return _rows(lines)


def verdict(starts: Sequence[Series], sizes: dict[str, tuple[int, int]]) -> str:
    """Say of each aim whether it is reached."""
    (stop,) = (each for each in starts if each.name == (BRIDGE, FIRST_STOP))
    stop_ms, pss_mb = stop.p50_ns / 1e6, sum(pss for _, pss in sizes.values()) / MB
    return "\n".join(
        f"- {what}: {value:.0f} of {limit} {unit}: {'reached' if value <= limit else 'not reached'}"
        for what, value, limit, unit in (
            ("T2's first STOP, p50", stop_ms, TO_REACH_MS, "ms"),
            ("memory of all on board, PSS", pss_mb, TO_REACH_MB, "MB"),
        )
    )


def _rows(lines: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
