"""Expected costs of the hot paths: ``counts.toml``."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

FILE = Path(__file__).with_name("counts.toml")
RENEW = "python -m verification.cost --renew"
# In eight runs on a busy host opcodes, allocations and system calls were identical, instructions
# within 0.02 %. A change elsewhere that only moves data in memory changes instructions by up to
# 1 %. Peak memory of a step is not counted: it differs by 2 %.
TOLERANCE = 0.03
HEADER = f"""\
# Cost of one step of each hot path, see `python -m verification.cost`; made by `{RENEW}`.
# A count that differs by more than the tolerance fails, up or down.
"""

Counts = Mapping[str, float]


class UncountableError(Exception):
    """The reason why something cannot be counted on this machine."""


@dataclass(frozen=True, slots=True)
class Section:
    """The counts of one kind, and the environment for which they are valid."""

    holds_for: str
    counts: Counts


def read(text: str) -> tuple[float, dict[str, Section]]:
    """Return the tolerance, and a section by kind."""
    table = tomllib.loads(text)
    tolerance = float(table.pop("tolerance"))
    return tolerance, {
        kind: Section(rows.pop("holds_for"), dict(rows)) for kind, rows in table.items()
    }


def written(tolerance: float, sections: Mapping[str, Section]) -> str:
    """Return the file's text."""
    blocks = [f"{HEADER}tolerance = {tolerance:g}\n"]
    for kind, section in sections.items():
        rows = "".join(f"{name} = {count:.10g}\n" for name, count in section.counts.items())
        blocks.append(f'[{kind}]\nholds_for = "{section.holds_for}"\n{rows}')
    return "\n".join(blocks)


def complaints(kind: str, expected: Counts, counted: Counts, tolerance: float) -> Iterator[str]:
    """Yield each count that differs by more than the tolerance, and what to do."""
    for name in sorted(expected.keys() | counted.keys()):
        if name not in expected or name not in counted:
            where = "counted" if name in counted else f"in {FILE.name}"
            yield f"{name}: {kind} only {where}; run `{RENEW}`"
            continue
        change = counted[name] / expected[name] - 1
        if abs(change) > tolerance:
            advice = "find the cause; if it is justified" if change > 0 else "if it is intended"
            yield (
                f"{name}: {counted[name]:.10g} {kind}, {expected[name]:.10g} expected "
                f"({change:+.1%}): {advice}, run `{RENEW}`"
            )
