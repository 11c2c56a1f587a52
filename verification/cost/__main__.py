"""``python -m verification.cost``: count the cost of the hot paths.

``--renew`` writes ``counts.toml``; counts that are not available here stay unchanged.
"""

import argparse
import sys
from collections.abc import Sequence

from verification.cost.ledger import (
    FILE,
    TOLERANCE,
    Counts,
    Section,
    UncountableError,
    read,
    written,
)
from verification.cost.methods import METHODS


def main(argv: Sequence[str] | None = None) -> int:
    """Count, print the tables, and write the file with ``--renew``."""
    parser = argparse.ArgumentParser(prog="python -m verification.cost", description=__doc__)
    parser.add_argument("--renew", action="store_true", help=f"write {FILE.name}")
    options = parser.parse_args(argv)
    sections: dict[str, Section] = {}
    if FILE.exists():
        _, sections = read(FILE.read_text(encoding="utf-8"))
    for method in METHODS:
        try:
            counted = method.count()
        except UncountableError as reason:
            print(f"{' and '.join(method.kinds)} are not counted: {reason}\n")
            continue
        for kind, counts in counted.items():
            print(table(kind, counts, sections[kind].counts if kind in sections else {}))
            sections[kind] = Section(method.holds_for(), counts)
    if options.renew:
        kinds = [kind for method in METHODS for kind in method.kinds if kind in sections]
        text = written(TOLERANCE, {kind: sections[kind] for kind in kinds})
        FILE.write_text(text, encoding="utf-8")
    return 0


def table(kind: str, counts: Counts, expected: Counts) -> str:
    """Return the counts of a kind with the expected ones."""
    lines = [f"{kind:28}{'counted':>14}{'expected':>14}"]
    for name, count in counts.items():
        known = f"{expected[name]:,.10g}" if name in expected else "-"
        lines.append(f"{name:28}{count:>14,.10g}{known:>14}")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(main())
