"""Blocks and targets of the document for the benchmark ``load``. Pure."""

from collections.abc import Mapping, Sequence
from statistics import median

from bench.series import Series
from bench.target import Target, verdict_of
from verification.harness.results import table

FRAMES_HZ = 5000  # target, without a loss, to one consumer
CPU_RATIO = 2.0  # of the two processes with Zenoh, a router and one pool, at most
MEMORY_MB = 150  # PSS together, at most
FEW, FRAMES = "1", "frames"
CHAIN, TOGETHER = "T2", "together"
OBSERVED = "T2, one consumer of everything"
BARE, BUS = "two processes by hand", "the same two, Zenoh, a router"
POOLED = f"{BUS}, one pool"
TO_BOARD, TO_BRIDGE, CONSUMER = "bridge to board, UDP", "board to bridge, UDP", "to the consumer"
MB, HOUR_S = 1_000_000, 3600

ByName = Mapping[tuple[str, ...], Series]


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    return {
        "throughput": throughput(by_name, throughput_targets(series)),
        "cost": cost(by_name, cost_targets(series)),
        "hour": hour(by_name),
        "turns": str(len(by_name[CHAIN, "cpu", TOGETHER].samples_ns)),
    }


def throughput(by_name: ByName, reached: Sequence[Target]) -> str:
    """Return a row for each number of consumers: the highest rate, and the loss at the next."""
    head = [
        "consumers", "frames/s without a loss", "delay p50 us", "p99 us", "bridge CPU %",
        "router CPU %", "machine %", "the next rate", "lost there",
        "targets",
    ]  # fmt: skip
    lines = []
    for count in consumers(by_name):
        found = tried(by_name, count)
        best = highest(by_name, count)
        row = [count, f"{best:,}"]
        row += _figures(by_name, count, best) if best else ["-"] * 5
        worse = min((hz for hz in found if hz > best), default=0)
        row += [f"{worse:,}", found[worse].note] if worse else ["-", "-"]
        lines.append([*row, verdict_of(FRAMES, reached) if count == FEW else ""])
    return table(head, lines)


def throughput_targets(series: Sequence[Series]) -> list[Target]:
    """Return the target of the rate to one consumer."""
    best = highest({each.name: each for each in series}, FEW)
    limit = f"{FRAMES_HZ:,} frames/s"
    figure = f"to 1 consumer: {best:,} frames/s"
    return [Target(FRAMES, figure, limit, best / FRAMES_HZ, 1.0, at_least=True)]


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


def cost(by_name: ByName, reached: Sequence[Target]) -> str:
    """Return a row for each process of T2, and one for each other candidate."""
    head = ["", "process", "CPU %", "of the pool's", "RSS MB", "PSS MB", "targets"]
    floor = middle(by_name, POOLED, "cpu", TOGETHER)
    lines = []
    for candidate in (CHAIN, BARE, BUS, POOLED):
        for name in processes(by_name, candidate) if candidate == CHAIN else [TOGETHER]:
            cpu = middle(by_name, candidate, "cpu", name)
            sizes = [middle(by_name, candidate, kind, name) / MB for kind in ("rss", "pss")]
            cells = [f"{cpu / 1e7:.1f}", f"× {cpu / floor:.1f}", *(f"{mb:.0f}" for mb in sizes)]
            verdict = verdict_of(candidate, reached) if name == TOGETHER else ""
            lines.append([candidate, name, *cells, verdict])
    return table(head, lines)


def cost_targets(series: Sequence[Series]) -> list[Target]:
    """Return the targets of CPU and memory."""
    by_name = {each.name: each for each in series}
    ours, theirs = (middle(by_name, each, "cpu", TOGETHER) / 1e7 for each in (CHAIN, POOLED))
    pss = middle(by_name, CHAIN, "pss", TOGETHER) / MB
    beside = f"{POOLED}: {theirs:.1f} %"
    limit = f"{MEMORY_MB} MB"
    return [
        Target(CHAIN, f"CPU: {ours:.1f} %", beside, ours / theirs, CPU_RATIO),
        Target(CHAIN, f"memory, PSS: {pss:.0f} MB", limit, pss / MEMORY_MB, 1.0),
    ]


def hour(by_name: ByName) -> str:
    """Return CPU seconds and megabytes of an hour."""
    lines = []
    for candidate in (CHAIN, BARE, BUS, POOLED):
        for name in processes(by_name, candidate):
            cpu_s = middle(by_name, candidate, "cpu", name) / 1e9 * HOUR_S
            lines.append([candidate, f"CPU, {name}", f"{cpu_s:,.0f} s"])
    for name in ("router", "bridge"):
        lines.append([OBSERVED, f"CPU added to the {name}", added(by_name, name)])
    for link in (TO_BRIDGE, TO_BOARD, CONSUMER):
        candidate = OBSERVED if link == CONSUMER else CHAIN
        size = middle(by_name, candidate, "bytes", link) * HOUR_S
        lines.append([candidate, link, f"{size / MB:,.1f} MB"])
    return table(["", "what", "in an hour"], lines)


def added(by_name: ByName, process: str) -> str:
    """Return the CPU seconds that a consumer adds to a process in an hour, and the noise."""
    both = [by_name[candidate, "cpu", process].samples_ns for candidate in (CHAIN, OBSERVED)]
    without, beside = (median(some) for some in both)
    spread = max(max(some) - min(some) for some in both)
    noise = ", within noise" if abs(beside - without) <= spread else ""
    return f"{(beside - without) / 1e9 * HOUR_S:,.0f} s{noise}"


def processes(by_name: ByName, candidate: str) -> list[str]:
    """Return the processes of a candidate, and the name of their sum."""
    return [name[2] for name in by_name if name[:2] == (candidate, "cpu")]


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
