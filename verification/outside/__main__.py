"""Run the scenarios against one tree or several, and print what each measured."""

import argparse
import contextlib
import os
import signal
import sys
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

from verification.outside.scenarios import SCENARIOS
from verification.outside.stack import stall_meter
from verification.outside.testbed import Result, Scenario, measure

PRIORITY = 55  # a real board is another computer: load on this host must not delay it
STALL_S = 0.06  # a longer stall of the host makes a failed measurement void
REPEATS = 2
HERE = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Measurement:
    """A result, and the host's worst stall meanwhile."""

    result: Result
    stall: float

    def text(self) -> str:
        stalled = f" [host stalled {self.stall * 1000:.0f} ms]" if self.stall > STALL_S else ""
        return f"{'ok  ' if self.result.ok else 'FAIL'} {self.result.measured}{stalled}"


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m verification.outside", description=__doc__)
    parser.add_argument("--tree", type=Path, action="append", metavar="PATH",
                        help="checkout with a .venv; repeat to compare several")  # fmt: skip
    parser.add_argument("--only", metavar="N[,N]", help="scenario groups, by number")
    parser.add_argument("--name", help="part of a scenario's function name")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="file for the table")
    return parser.parse_args()


def chosen(options: argparse.Namespace) -> list[Scenario]:
    lines = {int(line) for line in options.only.split(",")} if options.only else None
    found = [each for each in SCENARIOS if lines is None or each.line in lines]
    found = [each for each in found if not options.name or options.name in each.run.__name__]
    return sorted(found, key=lambda each: each.line)


def once(tree: Path, scenario: Scenario) -> Measurement:
    with stall_meter() as stalls:
        result = measure(tree, scenario)
    return Measurement(result, stalls[0])


def repeated(tree: Path, scenario: Scenario) -> Measurement:
    """Measure again what failed while the host stalled."""
    found = once(tree, scenario)
    for _ in range(REPEATS):
        if found.result.ok or found.stall <= STALL_S:
            break
        found = once(tree, scenario)
    return found


def ask_realtime() -> None:
    """Run as SCHED_FIFO, where that is granted."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


def table(rows: list[tuple[Scenario, list[Measurement]]], trees: list[Path]) -> str:
    """Return all results as a Markdown table."""
    names = [f"measured on {tree.name}" for tree in trees]
    head = ["group", "scenario", "expected", *names]
    lines = [head, ["---"] * len(head)]
    for scenario, found in rows:
        texts = [each.text().replace("|", "\\|") for each in found]
        lines.append([str(scenario.line), scenario.name, scenario.expected, *texts])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def main() -> int:
    """Return 1 when the last tree fails an expectation."""
    options = parse()
    trees = [tree.resolve() for tree in options.tree or [HERE]]
    ask_realtime()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # ends the processes of the scenario
    rows = []
    begin = time.monotonic()
    for scenario in chosen(options):
        print(f"\n{scenario.line:>2} {scenario.name}\n   expected: {scenario.expected}")
        found = []
        for tree in trees:
            found.append(repeated(tree, scenario))
            text = textwrap.fill(found[-1].text(), 100, subsequent_indent=" " * 20)
            print(f"   {tree.name:>14}: {text}", flush=True)
        rows.append((scenario, found))
    failed = sum(not found[-1].result.ok for _, found in rows)
    took = time.monotonic() - begin
    print(f"\n{len(rows)} scenarios, {failed} fail on {trees[-1].name}, {took:.0f} s\n")
    made = table(rows, trees)
    print(made)
    if options.markdown:
        options.markdown.write_text(made)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
