"""Blocks of the document for a path. Pure."""

from collections.abc import Sequence

from bench.reaction.page import latency_table
from bench.series import Series

FLOOR = "UDP, one process"


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks by name."""
    by_name = {each.name: each for each in series}
    return {
        "table": latency_table(by_name, "between both ends", FLOOR, "of UDP's"),
        "lost": lost(series),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
    }


def lost(series: Sequence[Series]) -> str:
    """Return the sentence about lost rounds."""
    notes = [f"{', '.join(one.name)}: {one.note}" for one in series if one.note]
    return f"Lost rounds, longer than a second: {'; '.join(notes) or 'none'}."
