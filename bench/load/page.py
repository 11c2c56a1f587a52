"""Blocks of the document for the benchmark ``load``. Pure."""

from collections.abc import Mapping, Sequence
from statistics import median

from bench.series import Series
from verification.harness.results import table

FRAMES_HZ = 5000  # target, without a loss
CPU_RATIO = 1.5  # of the two processes by hand, at most
MEMORY_MB = 150.0  # together, at most
CHAIN, TOGETHER = "T2", "together"
BARE, BUS = "two processes by hand", "the same two, Zenoh, a router"

ByName = Mapping[tuple[str, ...], Series]


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    return {
        "throughput": throughput(by_name),
        "throughput_verdict": throughput_verdict(by_name),
        "cost": cost(by_name),
        "cost_verdict": cost_verdict(by_name),
        "turns": str(len(by_name[CHAIN, "shipped", TOGETHER].samples_ns)),
    }


def throughput(by_name: ByName) -> str:
    """Return a row for each number of consumers: the highest rate, and the loss at the next."""
    head = [
        "consumers", "frames/s without a loss", "delay p50 us", "p99 us", "bridge CPU %",
        "router CPU %", "machine %", "the next rate", "lost there",
    ]  # fmt: skip
    lines = []
    for count in consumers(by_name):
        found = tried(by_name, count)
        best = highest(by_name, count)
        row = [count, f"{best:,}"]
        row += _figures(by_name, count, best) if best else ["-"] * 5
        worse = min((hz for hz in found if hz > best), default=0)
        row += [f"{worse:,}", found[worse].note] if worse else ["-", "-"]
        lines.append(row)
    return table(head, lines)


def throughput_verdict(by_name: ByName) -> str:
    """Return for each number of consumers whether the target is reached."""
    verdicts = []
    for count in consumers(by_name):
        best = highest(by_name, count)
        whom = "consumer" if count == "1" else "consumers"
        word = "reached" if best >= FRAMES_HZ else "not reached"
        verdicts.append(f"- to {count} {whom}: {best:,} of {FRAMES_HZ:,} frames/s: {word}")
    return "\n".join(verdicts)


def consumers(by_name: ByName) -> list[str]:
    """Return the numbers of consumers, in the order of measuring."""
    return list(dict.fromkeys(name[1] for name in by_name if name[0] == "frames"))


def tried(by_name: ByName, count: str) -> dict[int, Series]:
    """Return the delays at each rate; the note has the loss."""
    return {
        int(name[2]): one
        for name, one in by_name.items()
        if name[:2] == ("frames", count) and name[3] == "delay"
    }


def highest(by_name: ByName, count: str) -> int:
    """Return the highest rate below all rates with a loss; 0 without one."""
    found = tried(by_name, count)
    lossy = min((hz for hz, one in found.items() if one.note), default=max(found) + 1)
    return max((hz for hz in found if hz < lossy), default=0)


def cost(by_name: ByName) -> str:
    """Return a row for each process: CPU at both rates, and memory."""
    head = ["", "process", "CPU %", "CPU % tenfold", "RSS MB", "PSS MB"]
    lines = []
    for candidate in (CHAIN, BARE, BUS):
        names = [name[2] for name in by_name if name[:2] == (candidate, "shipped")]
        for name in names:
            shares = [
                middle(by_name, candidate, rate, name) / 1e7 for rate in ("shipped", "tenfold")
            ]
            sizes = [middle(by_name, candidate, kind, name) / 1e6 for kind in ("rss", "pss")]
            cells = [f"{share:.1f}" for share in shares] + [f"{size:.0f}" for size in sizes]
            lines.append([candidate, name, *cells])
    return table(head, lines)


def cost_verdict(by_name: ByName) -> str:
    """Return whether CPU and memory reach their targets."""
    verdicts = []
    for rate, words in (("shipped", "CPU at the shipped rates"), ("tenfold", "CPU at tenfold")):
        ratio = middle(by_name, CHAIN, rate, TOGETHER) / middle(by_name, BARE, rate, TOGETHER)
        word = "reached" if ratio <= CPU_RATIO else "not reached"
        verdicts.append(f"- {words} beside {BARE}: × {ratio:.1f} of × {CPU_RATIO}: {word}")
        ratio = middle(by_name, BUS, rate, TOGETHER) / middle(by_name, BARE, rate, TOGETHER)
        verdicts.append(f"  - {BUS}: × {ratio:.1f}")
    for kind, words in (("pss", "shared pages once"), ("rss", "shared pages in each")):
        size = middle(by_name, CHAIN, kind, TOGETHER) / 1e6
        word = "reached" if size <= MEMORY_MB else "not reached"
        verdicts.append(
            f"- memory together, {kind.upper()} ({words}): {size:.0f} of {MEMORY_MB:.0f} MB: {word}"
        )
    return "\n".join(verdicts)


def middle(by_name: ByName, *name: str) -> float:
    """Return the median of a row: nanoseconds a second, or bytes."""
    return median(by_name[name].samples_ns)


def _figures(by_name: ByName, count: str, hz: int) -> list[str]:
    name = "frames", count, str(hz)
    delay = by_name[*name, "delay"]
    shares = [
        middle(by_name, *name, candidate) / 1e7 for candidate in ("bridge", "router", "machine")
    ]
    return [
        f"{delay.p50_ns / 1000:,.0f}", f"{delay.p99_ns / 1000:,.0f}", *(f"{s:.0f}" for s in shares)
    ]  # fmt: skip
