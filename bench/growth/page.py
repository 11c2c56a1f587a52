"""Blocks and targets of the document for the benchmark ``growth``. Pure."""

from collections.abc import Mapping, Sequence

from bench.series import Series
from bench.target import Target, verdict_of
from verification.harness.results import table

CONSUMERS, SIZES = CURVES = ("consumers", "bytes")
COSTS = ("router", "bridge")
# Growth of the cost beyond the number that still counts as proportional: CPU time has a resolution
# of 10 ms, and other processes use the host.
MARGIN = 1.25

ByName = Mapping[tuple[str, ...], Series]
Point = tuple[float, float]  # number, cost


def steepest(points: Sequence[Point]) -> float:
    """Return by how much the cost outgrows the number at most, from any point to the last one."""
    *before, (most, last) = sorted(points)
    return max((last * n / (cost * most) for n, cost in before if cost > 0), default=0.0)


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name, reached = {each.name: each for each in series}, targets(series)
    return {"table": cost_table(by_name, reached), "margin": f"{MARGIN:g}"}


def targets(series: Sequence[Series]) -> list[Target]:
    """Return the targets: no cost and no delay grows faster than the number."""
    by_name = {each.name: each for each in series}
    return [
        Target(f"{curve}", f"{words}, growth", "growth of the number", steepest(curved), MARGIN)
        for curve in CURVES
        for what, words in (("router", "router CPU"), ("bridge", "bridge CPU"), ("delay", "p50"))
        if len(curved := points(by_name, curve, what)) > 1
    ]


def cost_table(by_name: ByName, reached: Sequence[Target]) -> str:
    """Return a row for each number: CPU in percent of a core, delay in us."""
    costs = [f"{process} CPU %" for process in COSTS]
    head = ["number", "of", *costs, "delay p50 us", "p99 us", "loss", "targets"]
    lines = []
    for curve in CURVES:
        numbers = list(dict.fromkeys(name[1] for name in by_name if name[0] == curve))
        for number in numbers:
            shares = [by_name.get((curve, number, process)) for process in COSTS]
            delay = by_name[curve, number, "delay"]
            times = [delay.p50_ns / 1000, delay.p99_ns / 1000] if delay.samples_ns else []
            lines.append([
                f"{int(number):,}", curve,
                *(f"{each.p50_ns / 1e7:.1f}" if each else "-" for each in shares),
                *([f"{us:,.0f}" for us in times] or ["-", "-"]), delay.note,
                verdict_of(curve, reached) if number == numbers[-1] else "",
            ])  # fmt: skip
    return table(head, lines)


def points(by_name: ByName, curve: str, what: str) -> list[Point]:
    """Return a curve: the median of each row in ns, by its number."""
    return [
        (float(name[1]), one.p50_ns)
        for name, one in by_name.items()
        if (name[0], name[2]) == (curve, what) and one.samples_ns
    ]
