"""``python -m tests.cost``: count what the hot paths cost, and print it beside what is expected.

``--renew`` writes ``counts.toml`` anew; what cannot be counted here stays as it is.
"""

import argparse
import sys
from collections.abc import Sequence

from tests.cost.kinds import KINDS, Kind
from tests.cost.ledger import FILE, TOLERANCE, Counts, Page, read, written
from tests.cost.uncountable import Uncountable


def main(argv: Sequence[str] | None = None) -> int:
    """Count, print the table, and renew the file when asked to."""
    parser = argparse.ArgumentParser(prog="python -m tests.cost", description=__doc__)
    parser.add_argument("--renew", action="store_true", help=f"write {FILE.name} anew")
    options = parser.parse_args(argv)
    pages: dict[str, Page] = {}
    if FILE.exists():
        _, pages = read(FILE.read_text(encoding="utf-8"))
    for kind in KINDS:
        try:
            counts = kind.count()
        except Uncountable as why:
            print(f"{kind.unit}: not counted, {why}\n")
            continue
        page = pages.get(kind.name)
        print(table(kind, counts, page.counts if page else {}))
        pages[kind.name] = Page(kind.holds_for(), counts)
    if options.renew:
        in_order = {kind.name: pages[kind.name] for kind in KINDS if kind.name in pages}
        FILE.write_text(written(TOLERANCE, in_order), encoding="utf-8")
    return 0


def table(kind: Kind, counts: Counts, expected: Counts) -> str:
    """Return the counts of a kind beside the expected ones."""
    lines = [f"{kind.unit + ' of a step':28}{'counted':>14}{'expected':>14}"]
    for name, count in counts.items():
        known = f"{expected[name]:,.10g}" if name in expected else "-"
        lines.append(f"{name:28}{count:>14,.10g}{known:>14}")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(main())
