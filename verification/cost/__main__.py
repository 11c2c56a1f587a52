"""``python -m verification.cost``: count what the hot paths cost, beside what is expected.

``--renew`` writes ``counts.toml`` anew; what cannot be counted here stays as it is.
"""

import argparse
import sys
from collections.abc import Sequence

from verification.cost.ledger import FILE, TOLERANCE, Counts, Page, read, written
from verification.cost.uncountable import Uncountable
from verification.cost.ways import WAYS


def main(argv: Sequence[str] | None = None) -> int:
    """Count, print the table, and renew the file when asked to."""
    parser = argparse.ArgumentParser(prog="python -m verification.cost", description=__doc__)
    parser.add_argument("--renew", action="store_true", help=f"write {FILE.name} anew")
    options = parser.parse_args(argv)
    pages: dict[str, Page] = {}
    if FILE.exists():
        _, pages = read(FILE.read_text(encoding="utf-8"))
    for way in WAYS:
        try:
            counted = way.count()
        except Uncountable as why:
            print(f"{' and '.join(way.kinds)} are not counted: {why}\n")
            continue
        for kind, counts in counted.items():
            print(table(kind, counts, pages[kind].counts if kind in pages else {}))
            pages[kind] = Page(way.holds_for(), counts)
    if options.renew:
        kinds = [kind for way in WAYS for kind in way.kinds if kind in pages]
        text = written(TOLERANCE, {kind: pages[kind] for kind in kinds})
        FILE.write_text(text, encoding="utf-8")
    return 0


def table(kind: str, counts: Counts, expected: Counts) -> str:
    """Return the counts of a kind beside the expected ones."""
    lines = [f"{kind:28}{'counted':>14}{'expected':>14}"]
    for name, count in counts.items():
        known = f"{expected[name]:,.10g}" if name in expected else "-"
        lines.append(f"{name:28}{count:>14,.10g}{known:>14}")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(main())
