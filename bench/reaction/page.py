"""What the part ``reaction`` says in the document. Pure."""

from collections.abc import Iterable, Mapping, Sequence

from bench.reaction.responders import DDS, FIFO, JUDGED, LOOP, REFLEX, ZENOH
from bench.series import Series

LOADS = ("quiet", "busy")
FIGURES = ("p50", "p99", "p99.9")
# What ours may take, at most, as a multiple of somebody else's.
TO_REACH = (
    (REFLEX, LOOP, {"p50": 1.3, "p99": 1.5}),
    (JUDGED, DDS, {"p50": 1.0, "p99": 1.0}),
    # Ours go ahead of ordinary processes: beside others that do.
    (REFLEX, LOOP + FIFO, {"p50": 1.3, "p99": 1.5}),
    (JUDGED, DDS + FIFO, {"p50": 1.0, "p99": 1.0}),
)

ByName = Mapping[tuple[str, ...], Series]


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks of the document by their names."""
    by_name = {each.name: each for each in series}
    return {
        "table": table(by_name),
        "verdict": verdict(by_name),
        "share": share(by_name),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
        "ahead": series[0].note,
    }


def table(
    by_name: ByName, who: str = "who reacts", floor: str = LOOP, of: str = "of the loop's"
) -> str:
    """Return a row for each of them, times in us; ``of`` heads how many times the floor's."""
    columns = [who, *(f"{load} {f}" for load in LOADS for f in (*FIGURES, of))]
    lines = [columns, ["---"] * len(columns)]
    for name in dict.fromkeys(name for name, _ in by_name):
        cells = [name]
        for load in LOADS:
            one = by_name[name, load]
            cells += [f"{figures(one)[each] / 1000:.0f}" for each in FIGURES]
            cells.append(f"× {one.ratio(by_name[floor, load]):.1f}")
        lines.append(cells)
    return rows(lines)


def rows(lines: Iterable[Sequence[str]]) -> str:
    """Return a table of the document."""
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def verdict(by_name: ByName) -> str:
    """Say of each aim whether it is reached."""
    said = []
    for ours, other, most in TO_REACH:
        for load in LOADS:
            if (other, load) not in by_name:
                continue
            mine, theirs = figures(by_name[ours, load]), figures(by_name[other, load])
            for figure, limit in most.items():
                ratio = mine[figure] / theirs[figure]
                word = "reached" if ratio <= limit else "not reached"
                said.append(
                    f"- {ours} beside {other}, {load}, {figure}: × {ratio:.2f} of × {limit}: {word}"
                )
    return "\n".join(said)


def share(by_name: ByName) -> str:
    """Say how much of a judged stop is the bus's; of CycloneDDS where that is installed."""
    told = []
    for load in LOADS:
        bus = by_name[ZENOH + FIFO, load]
        words = f"{bus.p50_ns / 1000:.0f} us"
        if (DDS + FIFO, load) in by_name:
            words += f", × {bus.ratio(by_name[DDS + FIFO, load]):.1f} of what CycloneDDS takes"
        ours = by_name[JUDGED, load].ratio(bus)
        told.append(f"{load.capitalize()}: {words}; T2 takes × {ours:.1f} of that")
    return ". ".join(told)


def figures(one: Series) -> dict[str, float]:
    """Return the figures of a row, in ns."""
    return {"p50": one.p50_ns, "p99": one.p99_ns, "p99.9": one.p999_ns}
