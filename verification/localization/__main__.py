"""``python -m verification.localization``: whether the pose in the map is as good as it says."""

import argparse
from itertools import count, islice
from multiprocessing import Pool
from statistics import fmean

from verification.localization.run import measure
from verification.search.draw import draw

LIMIT = 7.8  # 95 % of the squared errors, for three values: chi-square


def main() -> int:
    """Print a line for each vehicle, and the totals."""
    parser = argparse.ArgumentParser(prog="verification.localization", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="random vehicles without faults")
    runs = parser.parse_args().runs
    seeds = list(islice((seed for seed in count(1) if not draw(seed).faulty), runs))
    values: list[float] = []
    with Pool() as pool:
        for each in pool.imap(measure, seeds):
            values += each.nees
            print(
                f"{each.seed:5} mean {fmean(each.nees):6.2f}, below {LIMIT}: "
                f"{share(each.nees):4.0%}; {each.error:.2f} m off at worst, sigma {each.sigma:.2f} "
                f"m; placed {each.placed:.0%}; {each.used} used, {each.refused} refused; "
                f"{each.source}{', counters lost now and then' if each.mute else ''}"
            )
    print(
        f"{runs} vehicles, {len(values)} comparisons: mean squared error {fmean(values):.2f} "
        f"standard deviations (3 if honest), {share(values):.1%} below {LIMIT}"
    )
    return 0


def share(values: "tuple[float, ...] | list[float]") -> float:
    """Return the share of the values below the limit."""
    return sum(each < LIMIT for each in values) / len(values)


if __name__ == "__main__":
    raise SystemExit(main())
