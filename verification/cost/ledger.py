"""What the hot paths may cost: ``counts.toml``."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

FILE = Path(__file__).with_name("counts.toml")
RENEW = "python -m verification.cost --renew"
# Of eight runs on a busy machine: opcodes, allocations and system calls were the same each time,
# instructions within 0.02 %. A line elsewhere, which only moves what lies in memory, changes
# instructions by up to 1 %. What a step holds at its most is left out: it differs by 2 %.
TOLERANCE = 0.03
HEADER = f"""\
# What one step of each hot path costs, see `python -m verification.cost`; made by `{RENEW}`.
# A count that differs by more than the tolerance fails, up or down.
"""

Counts = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Page:
    """The counts of one kind, and what they hold for."""

    holds_for: str
    counts: Counts


def read(text: str) -> tuple[float, dict[str, Page]]:
    """Return the tolerance, and a page by kind."""
    table = tomllib.loads(text)
    tolerance = float(table.pop("tolerance"))
    return tolerance, {
        kind: Page(rows.pop("holds_for"), dict(rows)) for kind, rows in table.items()
    }


def written(tolerance: float, pages: Mapping[str, Page]) -> str:
    """Return the file's text."""
    blocks = [f"{HEADER}tolerance = {tolerance:g}\n"]
    for kind, page in pages.items():
        rows = "".join(f"{name} = {count:.10g}\n" for name, count in page.counts.items())
        blocks.append(f'[{kind}]\nholds_for = "{page.holds_for}"\n{rows}')
    return "\n".join(blocks)


def complaints(kind: str, expected: Counts, counted: Counts, tolerance: float) -> Iterator[str]:
    """Yield what differs by more than the tolerance, and what to do about it."""
    for name in sorted(expected.keys() | counted.keys()):
        if name not in expected or name not in counted:
            where = "counted" if name in counted else f"in {FILE.name}"
            yield f"{name}: {kind} stand only {where}; say `{RENEW}`"
            continue
        change = counted[name] / expected[name] - 1
        if abs(change) > tolerance:
            advice = "find out what for; if it is worth it" if change > 0 else "if it is meant so"
            yield (
                f"{name}: {counted[name]:.10g} {kind}, {expected[name]:.10g} expected "
                f"({change:+.1%}): {advice}, say `{RENEW}`"
            )
