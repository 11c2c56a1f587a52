"""What is said in the document of a path: from one end to the other, by each row. Pure."""

from collections.abc import Sequence

from bench.reaction.page import table
from bench.series import Series

FLOOR = "UDP, one process"


def blocks(series: Sequence[Series]) -> dict[str, str]:
    """Return the blocks of the document by their names."""
    by_name = {each.name: each for each in series}
    return {
        "table": table(by_name, "who is between", FLOOR, "of UDP's"),
        "lost": lost(series),
        "samples": f"{min(len(each.samples_ns) for each in series):,}",
    }


def lost(series: Sequence[Series]) -> str:
    """Say what did not go through within a second."""
    told = [f"{', '.join(one.name)}: {one.note}" for one in series if one.note]
    return f"Left out, as nothing came through within a second: {'; '.join(told) or 'nothing'}."
