"""``python -m verification.search``: random vehicles, rooms, operators and faults."""

import argparse
import multiprocessing
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec

from verification.search.page import page
from verification.search.run import Result, prepare_worker, run_seed


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign or one seed; return 1 when an invariant is broken."""
    parser = argparse.ArgumentParser(prog="python -m verification.search", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="the seeds 0 to N - 1; 1000")
    parser.add_argument("--out", type=Path, help="the page to write, docs/vehicles.md")
    parser.add_argument("--seed", type=int, help="run one seed and print it")
    options = parser.parse_args(argv)
    if options.seed is not None:
        return show(options.seed)
    results = campaign(options.runs, options.out)
    return int(any(result.violations for result in results))


def campaign(runs: int, out: Path | None = None) -> list[Result]:
    """Run the seeds in parallel, print violations, and renew the page every 500 runs."""
    began_s, found = time.monotonic(), []
    context = multiprocessing.get_context("spawn")
    with context.Pool(initializer=prepare_worker) as pool:
        for result in pool.imap_unordered(run_seed, range(runs), chunksize=4):
            found.append(result)
            if result.violations:
                print(f"seed {result.seed}: {result.violations[0]}", flush=True)
            if out and (len(found) % 500 == 0 or len(found) == runs):
                by_seed = sorted(found, key=lambda result: result.seed)
                out.write_text(page(by_seed), encoding="utf-8")
    print(f"{runs} runs in {(time.monotonic() - began_s) / 60:.0f} min")
    return found


def show(seed: int) -> int:
    """Print one run."""
    result = run_seed(seed)
    print(msgspec.json.format(msgspec.json.encode(result)).decode())
    return int(bool(result.violations))


if __name__ == "__main__":
    sys.exit(main())
