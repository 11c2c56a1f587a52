"""``python -m verification.vehicles``: random vehicles, worlds, operators and faults."""

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec

from verification.vehicles.campaign import drawn_and_run, read, results
from verification.vehicles.draw import Draw, draw
from verification.vehicles.page import page
from verification.vehicles.plot import save
from verification.vehicles.run import Result, fails_as, run
from verification.vehicles.shrink import shrink

RESULTS = Path("out/vehicles/runs.jsonl")
PLOT = Path("docs/images/vehicles.png")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign or one seed; return 1 when an invariant is broken."""
    options = _arguments().parse_args(argv)
    if options.seed is not None:
        return show(options.seed, shrinks=options.shrink)
    found = read(RESULTS) if options.resume else {}
    seeds = [seed for seed in range(options.runs) if seed not in found]
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    started_s = time.monotonic()
    with RESULTS.open("ab" if options.resume else "wb") as file:
        for result in results(seeds, options.processes):
            found[result.seed] = result
            file.write(msgspec.json.encode(result) + b"\n")
            file.flush()
            if result.violations:
                print(f"seed {result.seed}: {result.violations[0]}", flush=True)
    print(f"{len(seeds)} runs in {(time.monotonic() - started_s) / 60:.0f} min")
    all_of_them = [found[seed] for seed in sorted(found)]
    if options.out:
        options.out.write_text(page(all_of_them), encoding="utf-8")
        save(PLOT, all_of_them)
    return int(any(result.violations for result in all_of_them))


def show(seed: int, *, shrinks: bool) -> int:
    """Print one run, and the parameters that its failure needs."""
    result = drawn_and_run(seed)
    print(_json(result))
    failed = bool(result.violations or not result.completed)
    if shrinks and failed:
        same = fails_as(result)
        smallest = shrink(draw(seed), lambda smaller: same(run(smaller)))
        print("the failure needs:", _json(smallest.values))
        print(_json(run(Draw(seed, smallest.values))))
    return int(bool(result.violations))


def _json(found: Result | dict[str, object] | dict[str, bool | int | float | str]) -> str:
    return msgspec.json.format(msgspec.json.encode(found)).decode()


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m verification.vehicles", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="the seeds 0 to N - 1; 1000")
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, help="at once; as many as cores"
    )
    parser.add_argument("--resume", action="store_true", help=f"keep the results in {RESULTS}")
    parser.add_argument("--out", type=Path, help="the page to write, docs/vehicles.md")
    parser.add_argument("--seed", type=int, help="run one seed and print it")
    parser.add_argument(
        "--shrink", action="store_true", help="with --seed: find the parameters that matter"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
