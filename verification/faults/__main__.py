"""``python -m verification.faults``: inject every fault repeatedly, and renew the page."""

import argparse
import os
import platform
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TypeVar

from verification.faults import black_box
from verification.faults.black_box_scenarios import SCENARIOS
from verification.faults.catalogue import FAULTS, GROUPS
from verification.faults.fault import Fault
from verification.faults.namespaces import Requirement, enter, missing
from verification.faults.stack_fixture import stack_fixture
from verification.faults.table import Row, lines_of, render
from verification.faults.trial import run_trial
from verification.harness.host import StallRecorder, short_description
from verification.harness.stack import SETTINGS_FILE

Job = tuple[Requirement, Sequence[Fault]]
Named = TypeVar("Named", Fault, black_box.Scenario)

# Parallel stacks of each group. A trial waits most of the time: a core can run two stacks. Four
# stacks per core would stall each other beyond the limits.
CORES = max(2, os.cpu_count() or 2)
STACKS = (1, CORES, 2 * CORES)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign; return 1 when a row is outside its limits."""
    parser = _arguments()
    options = parser.parse_args(argv)
    faults = _chosen(FAULTS, options.only)
    scenarios = _chosen(SCENARIOS, options.only)
    if not faults and not scenarios:
        names = "\n  ".join([*(one.name for one in FAULTS), *(one.name for one in SCENARIOS)])
        parser.error(f"no fault is named {' or '.join(options.only)}; there are:\n  {names}")
    lacking = missing(enter())
    left_out = [f"{f.name}: {lacking[f.needs]}" for f in faults if f.needs in lacking]
    with StallRecorder() as stalls, tempfile.TemporaryDirectory() as folder:
        possible = [fault for fault in faults if fault.needs not in lacking]
        rows = campaign(possible, options.repeat, Path(folder), stalls)
        outcomes = [(one, black_box.tried(one, stalls)) for one in scenarios]
    old = options.out.read_text(encoding="utf-8") if options.only and options.out else ""
    text = page(rows, left_out, outcomes, old)
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    wrong = [(row.fault.name, violation) for row in rows for violation in row.violations[:3]]
    wrong += [(one.name, error) for one, error in outcomes if error]
    for name, what in wrong:
        print(f"{name}: {what}", file=sys.stderr)
    return int(bool(wrong))


def _chosen(all_of_them: Sequence[Named], only: Sequence[str]) -> list[Named]:
    """Return those whose name contains one of the texts; all without a text."""
    return [one for one in all_of_them if not only or any(text in one.name for text in only)]


def page(
    rows: Sequence[Row],
    left_out: Sequence[str],
    outcomes: Sequence[tuple[black_box.Scenario, str]],
    old: str,
) -> str:
    """Return the document; what did not run keeps its row of the old one."""
    old_table, heading, old_section = old.partition(black_box.HEADING)
    lines = lines_of(old_table) | {row.fault.name: row.line(today()) for row in rows}
    lines = {fault.name: lines[fault.name] for fault in FAULTS if fault.name in lines}
    text = render(f"{short_description()}, Python {platform.python_version()}", lines, left_out)
    return text + black_box.section(outcomes, today(), heading + old_section)


def campaign(
    faults: Sequence[Fault], repeat: int, folder: Path, stalls: StallRecorder
) -> list[Row]:
    """Run one group after the other, each on its own parallel stacks."""
    rows: list[Row] = []
    for number, (group, stacks) in enumerate(zip(GROUPS, STACKS, strict=True)):
        jobs = _jobs([fault for fault in faults if fault in group], stacks)
        rooms = [folder / f"{number}-{n}" for n in range(len(jobs))]
        with ThreadPoolExecutor(stacks) as pool:
            for done in pool.map(partial(_run, repeat=repeat, stalls=stalls), jobs, rooms):
                rows += done
    return rows


def _jobs(faults: Iterable[Fault], stacks: int) -> list[Job]:
    """Return the faults of each stack: of each requirement, and the rest in equal parts."""
    by_need: dict[Requirement, list[Fault]] = defaultdict(list)
    for fault in faults:
        by_need[fault.needs].append(fault)
    rest = by_need.pop("none", [])
    jobs: list[Job] = [*by_need.items(), *(("none", rest[n::stacks]) for n in range(stacks))]
    return [job for job in jobs if job[1]]


def _run(job: Job, room: Path, repeat: int, stalls: StallRecorder) -> list[Row]:
    """Run the faults of one stack."""
    need, faults = job
    rows = []
    room.mkdir()
    (room / SETTINGS_FILE).write_text("")
    with stack_fixture(room, need=need) as fixture:
        for fault in faults:
            samples = [run_trial(fixture, fault) for _ in range(repeat)]
            budget_s = fault.budget(fixture.running.config) if fault.budget else None
            stalls_s = [stalls.worst_s(s.fault_ns, fault.hold_s) for s in samples]
            rows.append(Row(fault, budget_s, samples, stalls_s))
            print(rows[-1].line(today()), file=sys.stderr, flush=True)
    return rows


def today() -> str:
    """Return the date in UTC."""
    return f"{datetime.now(UTC):%Y-%m-%d}"


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--repeat", type=int, default=20, help="trials per fault, 20")
    parser.add_argument(
        "--only", action="append", metavar="TEXT",
        help="only faults whose name contains TEXT; repeatable",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, metavar="FILE",
        help="write the page here; with --only replace only these rows",
    )  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())
