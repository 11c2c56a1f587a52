"""What the part ``growth`` says in the document. Pure."""

from collections.abc import Mapping, Sequence

from bench.growth.bend import MARGIN, Point, bend
from bench.series import Series

CONSUMERS, ROBOTS, KEYS, SIZES = CURVES = ("consumers", "robots", "keys", "bytes")
COSTS = ("router", "bridge")

ByName = Mapping[tuple[str, ...], Series]


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks of the document by their names."""
    by_name = {each.name: each for each in series}
    tables = {curve: f"{table(by_name, curve)}\n\n{bends(by_name, curve)}" for curve in CURVES}
    return tables | {"margin": f"{MARGIN - 1:.0%}"}


def table(by_name: ByName, curve: str) -> str:
    """Return a row for each number: CPU in percent of a core, delay in us."""
    costs = [who for who in COSTS if points(by_name, curve, who)]
    head = [curve, *(f"{who} CPU %" for who in costs), "delay p50 us", "p99 us", ""]
    lines = [head, ["---"] * len(head)]
    for number in numbers(by_name, curve):
        shares = [by_name.get((curve, number, who)) for who in costs]
        delay = by_name[curve, number, "delay"]
        times = [delay.p50_ns / 1000, delay.p99_ns / 1000] if delay.samples_ns else []
        lines.append([
            f"{int(number):,}", *(f"{each.p50_ns / 1e7:.1f}" if each else "-" for each in shares),
            *([f"{us:,.0f}" for us in times] or ["-", "-"]), delay.note,
        ])  # fmt: skip
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def bends(by_name: ByName, curve: str) -> str:
    """Say from where on each cost grows faster than the number."""
    said = []
    looks = [(who, f"CPU of the {who}", 0.5) for who in COSTS]
    looks += [("delay", "delay, p50", 0.5), ("delay", "delay, p99", 0.99)]
    for what, words, share in looks:
        curved = points(by_name, curve, what, share)
        if curved:
            at = bend(curved)
            said.append(f"{words}: {f'from {at:,.0f} on' if at is not None else 'nowhere'}")
    return f"Grows faster than the number of {curve}: {'; '.join(said)}."


def points(by_name: ByName, curve: str, what: str, share: float = 0.5) -> list[Point]:
    """Return a curve: what this share of a row's samples does not exceed, in ns, by its number."""
    return [
        (float(name[1]), one.percentile_ns(share))
        for name, one in by_name.items()
        if (name[0], name[2]) == (curve, what) and one.samples_ns
    ]


def numbers(by_name: ByName, curve: str) -> list[str]:
    """Return the numbers of a curve, in the order of measuring."""
    return list(dict.fromkeys(name[1] for name in by_name if name[0] == curve))
