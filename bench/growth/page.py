"""Blocks of the document for the benchmark ``growth``, and where a curve bends. Pure."""

from collections.abc import Mapping, Sequence

from bench.series import Series
from verification.harness.results import table

CONSUMERS, ROBOTS, KEYS, SIZES = CURVES = ("consumers", "robots", "keys", "bytes")
COSTS = ("router", "bridge")
# Growth of the cost beyond the number that still counts as proportional: CPU time has a resolution
# of 10 ms, and other processes use the host.
MARGIN = 1.25

ByName = Mapping[tuple[str, ...], Series]
Point = tuple[float, float]  # number, cost


def bend(points: Sequence[Point], margin: float = MARGIN) -> float | None:
    """Return the first number from which the cost grows faster than the number; else None.

    For each later point the cost has then grown by a larger factor than the number, beyond the
    margin. The last number is never returned.
    """
    rising = sorted(points)
    for index, (number, cost) in enumerate(rising[:-1]):
        if cost > 0 and all(c / cost > margin * n / number for n, c in rising[index + 1 :]):
            return number
    return None


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    tables = {curve: f"{cost_table(by_name, curve)}\n\n{bends(by_name, curve)}" for curve in CURVES}
    return tables | {"margin": f"{MARGIN - 1:.0%}"}


def cost_table(by_name: ByName, curve: str) -> str:
    """Return a row for each number: CPU in percent of a core, delay in us."""
    costs = [process for process in COSTS if points(by_name, curve, process)]
    head = [curve, *(f"{process} CPU %" for process in costs), "delay p50 us", "p99 us", ""]
    lines = []
    for number in numbers(by_name, curve):
        shares = [by_name.get((curve, number, process)) for process in costs]
        delay = by_name[curve, number, "delay"]
        times = [delay.p50_ns / 1000, delay.p99_ns / 1000] if delay.samples_ns else []
        lines.append([
            f"{int(number):,}", *(f"{each.p50_ns / 1e7:.1f}" if each else "-" for each in shares),
            *([f"{us:,.0f}" for us in times] or ["-", "-"]), delay.note,
        ])  # fmt: skip
    return table(head, lines)


def bends(by_name: ByName, curve: str) -> str:
    """Return the sentence on which costs grow faster than the number, and from where."""
    found = []
    kinds = [(process, f"CPU of the {process}", 0.5) for process in COSTS]
    kinds += [("delay", "delay, p50", 0.5), ("delay", "delay, p99", 0.99)]
    for what, words, share in kinds:
        curved = points(by_name, curve, what, share)
        if curved:
            at = bend(curved)
            found.append(f"{words}: {f'from {at:,.0f} on' if at is not None else 'nowhere'}")
    return f"Grows faster than the number of {curve}: {'; '.join(found)}."


def points(by_name: ByName, curve: str, what: str, share: float = 0.5) -> list[Point]:
    """Return a curve: the percentile of each row in ns, by its number."""
    return [
        (float(name[1]), one.percentile_ns(share))
        for name, one in by_name.items()
        if (name[0], name[2]) == (curve, what) and one.samples_ns
    ]


def numbers(by_name: ByName, curve: str) -> list[str]:
    """Return the numbers of a curve, in the order of measuring."""
    return list(dict.fromkeys(name[1] for name in by_name if name[0] == curve))
