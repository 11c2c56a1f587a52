"""Blocks and targets of the document for the benchmark ``reaction``. Pure."""

from collections.abc import Mapping, Sequence

from bench.reaction.responders import DDS, DDS_FIFO, JUDGED, LOADS, LOOP, ORDINARY, POOLED, REFLEX
from bench.series import Series
from bench.target import Target, verdict_of
from verification.harness.results import table

FIGURES = ("p50", "p99", "p99.9")
# At most these multiples of the other row.
LIMITS = (
    (REFLEX, LOOP, {"p50": 1.3, "p99": 1.5}),
    (JUDGED, DDS_FIFO, {"p50": 1.0, "p99": 1.5}),
    (JUDGED, POOLED, {"p50": 1.0}),
    (ORDINARY, DDS, {"p50": 1.0, "p99": 1.5}),
)

ByName = Mapping[tuple[str, ...], Series]
Limits = Sequence[tuple[str, str, Mapping[str, float]]]


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    return {
        "table": latency_table(by_name, targets(series)),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
        "granted": series[0].note,
    }


def targets(series: Sequence[Series]) -> list[Target]:
    """Return the targets of the reaction."""
    return compared({each.name: each for each in series}, LIMITS)


def latency_table(
    by_name: ByName,
    reached: Sequence[Target],
    head: str = "responder",
    floor: str = LOOP,
    of: str = "of the loop's",
) -> str:
    """Return the table of percentiles in us; ``of`` is the head of the ratio to the floor."""
    columns = [head, *(f"{load} {f}" for load in LOADS for f in (*FIGURES, of)), "targets"]
    lines = []
    for name in dict.fromkeys(name for name, _ in by_name):
        cells = [name]
        for load in LOADS:
            one = by_name.get((name, load))
            if one is None:
                cells += [""] * (len(FIGURES) + 1)
                continue
            cells += [f"{ns / 1000:.0f}" for ns in figures(one).values()]
            cells.append(f"× {one.ratio(by_name[floor, load]):.1f}")
        lines.append([*cells, verdict_of(name, reached)])
    return table(columns, lines)


def compared(by_name: ByName, limits: Limits) -> list[Target]:
    """Return the targets of rows beside others; none for a row that was not measured."""
    return [
        Target(
            ours, f"{load}, {figure}: {mine[figure] / 1000:,.0f} us",
            f"{other}: {theirs[figure] / 1000:,.0f} us", mine[figure] / theirs[figure], limit,
        )
        for ours, other, most in limits
        for load in LOADS
        if {(ours, load), (other, load)} <= by_name.keys()
        for mine, theirs in [(figures(by_name[ours, load]), figures(by_name[other, load]))]
        for figure, limit in most.items()
    ]  # fmt: skip


def figures(one: Series) -> dict[str, float]:
    """Return the percentiles of a row, in ns."""
    return dict(zip(FIGURES, (one.p50_ns, one.p99_ns, one.p999_ns), strict=True))
