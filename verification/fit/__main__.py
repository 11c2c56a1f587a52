"""``python -m verification.fit``: fit the profiles' and random vehicles, and count what holds."""

import argparse
from multiprocessing import Pool

from verification.fit.run import measure, vehicles


def main() -> int:
    """Print a line for each vehicle that something is to be said of, and the totals."""
    parser = argparse.ArgumentParser(prog="verification.fit", description=__doc__)
    parser.add_argument("--runs", type=int, default=300, help="random vehicles")
    runs = parser.parse_args().runs
    with Pool() as pool:
        results = list(pool.imap(measure, vehicles(runs), chunksize=1))
    for each in results:
        for text in (*each.missing[:1], *each.unsafe, *each.outside):
            print(f"{each.name}: {text}")
    proposals = [each for each in results if each.proposes]
    safe = sum(not each.unsafe for each in proposals)
    inside = sum(each.inside for each in results)
    outside = sum(len(each.outside) for each in results)
    print(
        f"{len(results)} vehicles; {len(proposals)} with a proposal, {safe} of them "
        f"({safe / len(proposals):.1%}) on the safe side; {inside} of {inside + outside} truths "
        f"({inside / (inside + outside):.1%}) within their intervals"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
