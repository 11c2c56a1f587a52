"""Blocks and targets of the document for a path. Pure."""

from collections.abc import Sequence

from bench.adapters.buses import POOLED
from bench.reaction.page import compared, latency_table
from bench.series import Series
from bench.target import Target

T2, FLOOR = "T2", "UDP, one process"
LIMITS = ((T2, POOLED.title, {"p50": 2.0}),)


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    reached = targets(series)
    return {
        "table": latency_table(by_name, reached, "between both ends", FLOOR, "of UDP's"),
        "lost": lost(series),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
    }


def targets(series: Sequence[Series]) -> list[Target]:
    """Return the targets of a path."""
    return compared({each.name: each for each in series}, LIMITS)


def lost(series: Sequence[Series]) -> str:
    """Return the sentence about lost rounds."""
    notes = [f"{', '.join(one.name)}: {one.note}" for one in series if one.note]
    return f"Lost rounds, longer than a second: {'; '.join(notes) or 'none'}."
