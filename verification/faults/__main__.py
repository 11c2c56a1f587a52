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

from verification.faults.catalogue import FAULTS, GROUPS
from verification.faults.fault import HEAD, Fault, Row, run_row
from verification.faults.namespaces import enter
from verification.faults.stack_fixture import Requirement, stack_fixture
from verification.harness.host import StallRecorder, description
from verification.harness.results import table

PAGE = """# Faults

`make faults` renews this page; last run: {machine}. Real processes, real UDP, the simulated board,
0.8 m/s on an empty plane while motion is requested.

- *median, worst*: time from the fault to the last command at the board that moves the vehicle, or
  to the first STOP or BRAKE if that is later.
- *stall*: the longest time that the host kept a sleeping process from running during a sample, plus
  the time that the kernel took to end a killed process. A sample may exceed its budget by it.
- *then*: what it takes to drive again after the fault. A stall of over 50 ms may add a neutral
  request, never a reset.
- *independent board*: in place of the simulated board, one that was written from the manual and
  imports nothing of this project. In all rows the clients are plain Zenoh, written from
  [bus.md](bus.md).

{faults}

{verdict}
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign; return 1 when a row is outside its limits."""
    parser = _arguments()
    options = parser.parse_args(argv)
    faults = [one for one in FAULTS if any(text in one.name for text in options.only or [""])]
    if not faults:
        names = "\n  ".join(one.name for one in FAULTS)
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
    text = page(lines)
    print(text, *wrong, sep="\n")
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return int(bool(wrong))


def lines_of(page: str) -> dict[str, str]:
    """Return the rows of a page's table by name."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    return {line.split(" | ")[0].removeprefix("| "): line for line in lines}


def page(lines: Mapping[str, str]) -> str:
    """Return the page with the rows of the catalogue that have a line."""
    rows = {one.name: lines[one.name] for one in FAULTS if one.name in lines}
    wrong = [name for name, line in rows.items() if line.endswith("| WRONG |")]
    verdict = "All rows are within their limits."
    if wrong:
        verdict = f"Outside their limits: {', '.join(wrong)}."
    machine = f"{description()}, Python {platform.python_version()}"
    faults = "\n".join([table(HEAD, []), *rows.values()])
    return PAGE.format(machine=machine, faults=faults, verdict=verdict)


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
    with (
        tempfile.TemporaryDirectory() as folder,
        stack_fixture(Path(folder), need=faults[0].needs) as fixture,
    ):
        for one in faults:
            rows.append(run_row(fixture, one, stalls, repeat))
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
