"""``python -m verification.fit``: fit the profiles' and random vehicles, and count what holds."""

import argparse
from multiprocessing import Pool
from statistics import median

from verification.fit.run import NEAR, Result, measure, vehicles
from verification.search.run import prepare_worker


def main() -> int:
    """Print a line for each vehicle that something is to be said of, and the totals."""
    parser = argparse.ArgumentParser(prog="verification.fit", description=__doc__)
    parser.add_argument("--runs", type=int, default=300, help="random vehicles")
    parser.add_argument("--skip", type=int, default=0, help="vehicles of an earlier run, the first")
    options = parser.parse_args()
    chosen = vehicles(options.runs)[options.skip :]
    results = []
    with Pool(initializer=prepare_worker) as pool:
        for each in pool.imap(measure, chosen, chunksize=1):
            results.append(each)
            for text in (*each.missing[:1], *each.unsafe, *each.outside, *each.wrong):
                print(f"{each.name}: {text}", flush=True)
    print_totals(results)
    return 0


def print_totals(results: list[Result]) -> None:
    """Print what holds of how many."""
    proposals = [each for each in results if each.proposes]
    safe = sum(not each.unsafe for each in proposals)
    inside = sum(each.inside for each in results)
    outside = sum(len(each.outside) for each in results)
    print(
        f"{len(results)} vehicles; {len(proposals)} with a proposal, {safe} of them "
        f"({safe / len(proposals):.1%}) on the safe side; {inside} of {inside + outside} truths "
        f"({inside / (inside + outside):.1%}) within their intervals"
    )
    pairs = [(it.today, it.proposed) for it in results if it.today and it.proposed]
    worse = sum(bool(set(new.contacts) - set(old.contacts)) for old, new in pairs)
    print(f"{len(pairs)} driven with both settings; {worse} have contacts that today's do not have")
    for name, runs in zip(("today's", "proposed"), zip(*pairs, strict=True), strict=True):
        laps = sum(not each.failed for each in runs)
        hits = sum(bool(each.contacts) for each in runs)
        nearest = [each.nearest for each in runs]
        print(
            f"{name}: {laps} laps completed, {hits} vehicles with contacts, nearest to a wall "
            f"{median(nearest):.2f} m in the median, {sum(it < NEAR for it in nearest)} times "
            f"under {NEAR:g} m"
        )


if __name__ == "__main__":
    raise SystemExit(main())
