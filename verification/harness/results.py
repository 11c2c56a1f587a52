"""Result tables: percentiles, Markdown tables, and pages with generated blocks."""

import math
from collections.abc import Iterable, Mapping, Sequence


def percentile(values: Sequence[float], share: float) -> float:
    """Return the percentile of a share, 0 to 1 (nearest rank)."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)]


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, without a line end after its last row."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """Return a page with its generated blocks replaced.

    A block stands between ``<!-- name -->`` and ``<!-- end -->``.
    """
    for name, block in blocks.items():
        begin = text.index(f"<!-- {name} -->\n") + len(f"<!-- {name} -->\n")
        end = text.index("<!-- end -->", begin)
        text = f"{text[:begin]}{block}\n{text[end:]}"
    return text
