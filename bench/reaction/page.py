"""Blocks of the document for the benchmark ``reaction``. Pure."""

from collections.abc import Mapping, Sequence

from bench.reaction.responders import DDS, FIFO, JUDGED, LOOP, REFLEX, ZENOH
from bench.series import Series
from verification.harness.results import table

LOADS = ("quiet", "busy")
FIGURES = ("p50", "p99", "p99.9")
# Targets: at most this multiple of the other row.
TARGETS = (
    (REFLEX, LOOP, {"p50": 1.3, "p99": 1.5}),
    (JUDGED, DDS, {"p50": 1.0, "p99": 1.0}),
    # T2 runs as SCHED_FIFO: compared with others that do.
    (REFLEX, LOOP + FIFO, {"p50": 1.3, "p99": 1.5}),
    (JUDGED, DDS + FIFO, {"p50": 1.0, "p99": 1.0}),
)

ByName = Mapping[tuple[str, ...], Series]


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    return {
        "table": latency_table(by_name),
        "verdict": verdict(by_name),
        "share": share(by_name),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
        "ahead": series[0].note,
    }


def latency_table(
    by_name: ByName, head: str = "responder", floor: str = LOOP, of: str = "of the loop's"
) -> str:
    """Return the table of percentiles in us; ``of`` is the head of the ratio to the floor."""
    columns = [head, *(f"{load} {f}" for load in LOADS for f in (*FIGURES, of))]
    lines = []
    for name in dict.fromkeys(name for name, _ in by_name):
        cells = [name]
        for load in LOADS:
            one = by_name[name, load]
            cells += [f"{figures(one)[each] / 1000:.0f}" for each in FIGURES]
            cells.append(f"× {one.ratio(by_name[floor, load]):.1f}")
        lines.append(cells)
    return table(columns, lines)


def verdict(by_name: ByName) -> str:
    """Return which targets are reached."""
    lines = []
    for ours, other, most in TARGETS:
        for load in LOADS:
            if (other, load) not in by_name:
                continue
            mine, theirs = figures(by_name[ours, load]), figures(by_name[other, load])
            for figure, limit in most.items():
                ratio = mine[figure] / theirs[figure]
                word = "reached" if ratio <= limit else "not reached"
                lines.append(
                    f"- {ours} beside {other}, {load}, {figure}: × {ratio:.2f} of × {limit}: {word}"
                )
    return "\n".join(lines)


def share(by_name: ByName) -> str:
    """Return the share of the bus in a judged stop; beside CycloneDDS where that is installed."""
    sentences = []
    for load in LOADS:
        bus = by_name[ZENOH + FIFO, load]
        words = f"{bus.p50_ns / 1000:.0f} us"
        if (DDS + FIFO, load) in by_name:
            words += f", × {bus.ratio(by_name[DDS + FIFO, load]):.1f} of what CycloneDDS takes"
        ours = by_name[JUDGED, load].ratio(bus)
        sentences.append(f"{load.capitalize()}: {words}; T2 takes × {ours:.1f} of that")
    return ". ".join(sentences)


def figures(one: Series) -> dict[str, float]:
    """Return the percentiles of a row, in ns."""
    return {"p50": one.p50_ns, "p99": one.p99_ns, "p99.9": one.p999_ns}
