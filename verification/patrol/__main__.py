"""``python -m verification.patrol``: random vehicles drive rounds; what the truth says of them."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from multiprocessing import get_context

import msgspec

from verification.patrol.run import Result, measure
from verification.search.run import prepare_worker


def main(argv: Sequence[str] | None = None) -> int:
    """Drive vehicles, or one; return 1 when something is broken."""
    parser = argparse.ArgumentParser(prog="verification.patrol", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="random vehicles, half with faults")
    parser.add_argument("--seed", type=int, default=0, help="the seed of the first one")
    parser.add_argument("--only", type=int, help="run one seed and print it")
    options = parser.parse_args(argv)
    if options.only is not None:
        found = measure(options.only)
        print(msgspec.json.format(msgspec.json.encode(found)).decode())
        return int(bool(found.broken))
    results = []
    with get_context("spawn").Pool(initializer=prepare_worker) as pool:
        for each in pool.imap_unordered(measure, range(options.seed, options.seed + options.runs)):
            results.append(each)
            left = each.deviation > each.corridor
            outside = f"{each.deviation:.2f} m off, corridor {each.corridor:.2f} m: {each.claims}"
            for text in (*each.broken, *each.unexpected, *((outside,) if left else ())):
                print(f"{each.seed}: {text}", flush=True)
    print_totals(results)
    return int(any(each.broken for each in results))


def print_totals(results: Sequence[Result]) -> None:
    """Print what holds of how many rounds."""
    for title, faulty, blind in (
        ("without a fault", False, False),
        ("without a fault, without fixes", False, True),
        ("with faults", True, False),
        ("with faults, without fixes", True, True),
    ):
        rounds = [it for it in results if (it.faulty, it.blind) == (faulty, blind)]
        ends = Counter("home" if it.is_home else it.result for it in rounds)
        print(
            f"{title}: {len(rounds)} vehicles; {sum(not it.unexpected for it in rounds)} rounds "
            f"ended as they must; {', '.join(f'{count} {name}' for name, count in ends.items())}"
        )
    outside = sum(it.deviation > it.corridor for it in results)
    print(
        f"{len(results)} vehicles; {sum(bool(it.broken) for it in results)} broke something; "
        f"{outside} were outside of the corridor while motion was requested; "
        f"{sum(it.cpu_s for it in results) / max(1, len(results)):.1f} s of CPU each"
    )


if __name__ == "__main__":
    sys.exit(main())
