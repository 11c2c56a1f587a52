"""Blocks and targets of the document for the benchmark ``telemetry``. Pure."""

from collections.abc import Sequence

from bench.path import page
from bench.reaction.responders import LOADS
from bench.series import Series
from bench.target import Target, verdict_of
from common import keys
from services.safety.config import Safety
from verification.harness.results import table

AGE = "age"  # in the name of a series: stream, AGE, load
MS = 1_000_000
SAFETY = Safety()
STREAMS = (
    ("velocity", keys.VELOCITY, SAFETY.velocity_age),
    ("ultrasonic", keys.ULTRASONIC, SAFETY.ultrasonic_age),
    ("bumper", keys.BUMPER, SAFETY.bumper_age),
)


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    aged = {one.name: one for one in series if AGE in one.name}
    return {
        **page.blocks(path(series)),
        "ages": ages(aged),
        "decisions": f"{min(len(one.samples_ns) for one in aged.values()):,}",
    }


def path(series: Sequence[Series]) -> list[Series]:
    """Return the rows of the path, without ages."""
    return [one for one in series if AGE not in one.name]


def targets(series: Sequence[Series]) -> list[Target]:
    """Return the targets of the path."""
    return page.targets(path(series))


def age_targets(series: Sequence[Series]) -> list[Target]:
    """Return the targets of the ages: none is older than allowed."""
    by_name = {one.name: one for one in series}
    return [
        Target(name, f"{load}, max: {ms:.1f} ms", f"allowed: {limit_ms:.0f} ms", ms / limit_ms, 1.0)
        for name, _, allowed_s in STREAMS
        for load in LOADS
        for ms, limit_ms in [(max(by_name[name, AGE, load].samples_ns) / MS, 1000 * allowed_s)]
    ]


def ages(by_name: dict[tuple[str, ...], Series]) -> str:
    """Return a row for each stream, times in ms."""
    figures = [f"{load} {figure}" for load in LOADS for figure in ("p50", "p99", "max")]
    head = ["sample", "Hz", *figures, "allowed", "targets"]
    reached = age_targets(list(by_name.values()))
    lines = []
    for name, topic, allowed_s in STREAMS:
        cells = [name, f"{topic.rate_hz:g}"]
        for load in LOADS:
            one = by_name[name, AGE, load]
            cells += [f"{ns / MS:.1f}" for ns in (one.p50_ns, one.p99_ns, max(one.samples_ns))]
        lines.append([*cells, f"{1000 * allowed_s:.0f}", verdict_of(name, reached)])
    return table(head, lines)
