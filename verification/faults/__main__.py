"""``python -m verification.faults``: inject every fault repeatedly, and renew the page."""

import argparse
import platform
import sys
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TypeVar

from verification.faults import black_box, fault
from verification.faults.black_box_scenarios import SCENARIOS
from verification.faults.catalogue import FAULTS, GROUPS
from verification.faults.fault import Fault, Row, run_trial
from verification.faults.namespaces import enter
from verification.faults.stack_fixture import Requirement, stack_fixture
from verification.harness.host import StallRecorder, short_description
from verification.harness.results import table
from verification.harness.stack import SETTINGS_FILE

Named = TypeVar("Named", Fault, black_box.Scenario)
PAGE = """# Faults

`make faults` renews this page; last run: {machine}. Real processes, real UDP, the simulated board,
0.8 m/s on an empty plane while motion is requested.

- *median, worst*: time from the fault to the last command at the board that moves the vehicle, or
  to the first STOP or BRAKE if that is later.
- *stall*: the longest time that the host kept a sleeping process from running during a sample, plus
  the time that the kernel took to end a killed process. A sample may exceed its budget by it.
- *then*: what it takes to drive again after the fault.

{faults}

{verdict}

## Black box

An independent board and plain Zenoh clients, written from the manual and [bus.md](bus.md), that
import nothing of this project. Each row has its own stack with the shipped limits. BRAKE in time is
BRAKE within 0.1 s.

{black_box}
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign; return 1 when a row is outside its limits."""
    parser = _arguments()
    options = parser.parse_args(argv)
    faults, scenarios = _chosen(FAULTS, options.only), _chosen(SCENARIOS, options.only)
    if not faults and not scenarios:
        names = "\n  ".join([*(one.name for one in FAULTS), *(one.name for one in SCENARIOS)])
        parser.error(f"no fault is named {' or '.join(options.only)}; there are:\n  {names}")
    try:
        enter()
    except OSError as error:
        parser.error(str(error))
    date = f"{datetime.now(UTC):%Y-%m-%d}"
    old = options.out.read_text(encoding="utf-8") if options.out and options.out.exists() else ""
    lines, wrong = lines_of(old), []
    with StallRecorder() as stalls:
        for row in campaign(faults, options.repeat, stalls):
            lines[row.fault.name] = row.line(date)
            wrong += [f"{row.fault.name}: {violation}" for violation in row.violations[:3]]
        for one in scenarios:
            error_text = black_box.tried(one, stalls)
            lines[one.name] = one.line(error_text, date)
            wrong += [f"{one.name}: {error_text}"] if error_text else []
    text = page(lines)
    print(text, *wrong, sep="\n")
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return int(bool(wrong))


def _chosen(all_of_them: Sequence[Named], only: Sequence[str]) -> list[Named]:
    """Return those whose name contains one of the texts; all without a text."""
    return [one for one in all_of_them if not only or any(text in one.name for text in only)]


def lines_of(page: str) -> dict[str, str]:
    """Return the rows of a page's tables by name."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    return {line.split(" | ")[0].removeprefix("| "): line for line in lines}


def page(lines: Mapping[str, str]) -> str:
    """Return the page with the rows of the catalogue that have a line."""
    tables = [
        "\n".join([table(head, []), *(lines[one.name] for one in rows if one.name in lines)])
        for head, rows in ((fault.HEAD, FAULTS), (black_box.HEAD, SCENARIOS))
    ]
    wrong = [name for name, line in lines.items() if line.endswith("| WRONG |")]
    verdict = "All rows are within their limits."
    if wrong:
        verdict = f"Outside their limits: {', '.join(wrong)}."
    machine = f"{short_description()}, Python {platform.python_version()}"
    return PAGE.format(machine=machine, faults=tables[0], verdict=verdict, black_box=tables[1])


def campaign(faults: Sequence[Fault], repeat: int, stalls: StallRecorder) -> list[Row]:
    """Run one group after the other, each on its own parallel stacks."""
    rows: list[Row] = []
    for stacks, group in GROUPS:
        jobs: dict[tuple[Requirement, int], list[Fault]] = defaultdict(list)
        for number, one in enumerate(one for one in faults if one in group):
            jobs[one.needs, number % stacks if one.needs == "none" else 0].append(one)
        with ThreadPoolExecutor(stacks) as pool:
            for done in pool.map(partial(_run, repeat=repeat, stalls=stalls), jobs.values()):
                rows += done
    return rows


def _run(faults: Sequence[Fault], repeat: int, stalls: StallRecorder) -> list[Row]:
    """Run the faults of one stack."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / SETTINGS_FILE).write_text("")
        with stack_fixture(folder, need=faults[0].needs) as fixture:
            for one in faults:
                samples = [run_trial(fixture, one) for _ in range(repeat)]
                budget_s = one.budget(fixture.running.config) if one.budget else None
                stalls_s = [stalls.worst_s(s.fault_ns, one.hold_s) for s in samples]
                rows.append(Row(one, budget_s, samples, stalls_s))
                print(rows[-1].line(""), file=sys.stderr, flush=True)
    return rows


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--repeat", type=int, default=10, help="trials per fault, 10")
    parser.add_argument(
        "--only", action="append", metavar="TEXT",
        help="only faults whose name contains TEXT; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, metavar="FILE",
        help="renew these rows of a page"
    )  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())
