"""``python -m tests.faults``: every fault of the catalogue, again and again, as a table."""

import argparse
import os
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from queue import Empty, SimpleQueue

from tests.faults.catalogue import FAULTS, QUIET, Fault
from tests.faults.deeds import no_starving
from tests.faults.lane import lane
from tests.faults.machine import HoldUps
from tests.faults.table import Row, markdown
from tests.faults.trial import tried

LANES = 5


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign; return 1 when a row is not as it should be."""
    options = _arguments().parse_args(argv)
    faults = [f for f in FAULTS if not options.only or any(o in f.name for o in options.only)]
    started_s = time.monotonic()
    with HoldUps() as holdups, tempfile.TemporaryDirectory() as folder:
        rows = campaign(faults, options.repeat, Path(folder), holdups)
    took_s = time.monotonic() - started_s
    text = report(rows, took_s)
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    for row in rows:
        for fault in row.faults[:3]:
            print(f"{row.name}: {fault}", file=sys.stderr)
    return int(any(row.faults for row in rows))


def campaign(faults: Sequence[Fault], repeat: int, folder: Path, holdups: HoldUps) -> list[Row]:
    """Try those that want quiet one after another, then the others on several lanes."""
    reason = no_starving()
    if reason:
        print(f"left out: out of memory: {reason}", file=sys.stderr)
        faults = [fault for fault in faults if "memory" not in fault.name]
    rows: dict[str, Row] = {}
    quiet = [fault for fault in faults if fault in QUIET]
    others = [fault for fault in faults if fault not in QUIET]
    for part, lanes in ((quiet, 1), (others, LANES)):
        queue: SimpleQueue[Fault] = SimpleQueue()
        for fault in part:
            queue.put(fault)
        if part:
            with ThreadPoolExecutor(lanes) as pool:
                jobs = [
                    pool.submit(_drive, folder / f"{lanes}-{n}", queue, repeat, holdups, rows)
                    for n in range(lanes)
                ]
                for job in jobs:
                    job.result()
    return [rows[fault.name] for fault in faults]


def _drive(
    folder: Path,
    queue: "SimpleQueue[Fault]",
    repeat: int,
    holdups: HoldUps,
    rows: dict[str, Row],
) -> None:
    folder.mkdir()
    (folder / "lane.toml").write_text("")
    with lane(folder) as it:
        while True:
            try:
                fault = queue.get_nowait()
            except Empty:
                return
            samples = [tried(it, fault) for _ in range(repeat)]
            budget_s = fault.budget(it.stack.config) if fault.budget else None
            held = [holdups.worst_s(s.fault_ns, fault.hold_s) for s in samples]
            rows[fault.name] = Row(fault.name, budget_s, fault.outcome, samples, held)
            print(markdown([rows[fault.name]]).splitlines()[-1], file=sys.stderr, flush=True)


def report(rows: Sequence[Row], took_s: float) -> str:
    """Return the campaign as a document."""
    wrong = [row.name for row in rows if row.faults]
    return TEXT.format(
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        machine=f"{platform.machine()}, {os.cpu_count()} cores, Linux {platform.release()}",
        python=platform.python_version(),
        minutes=round(took_s / 60),
        table=markdown(rows),
        verdict=f"Not as it should be: {', '.join(wrong)}."
        if wrong
        else "All are as they should be.",
    )


TEXT = """# Faults

Made by `make faults` on {date}: {machine}, Python {python}, {minutes} minutes.

Real processes, real UDP, the simulated board, 0.8 m/s on an empty plain with the stick held on.

- *p50, p99, worst*: from the fault to the last command to move that the board received, or to the
  first STOP or BREAK if that came later.
- *held up*: how long the machine kept a process that only sleeps from running, at worst, while a
  sample lasted. A sample may take so much longer than its budget.
- *then*: what it took to drive again once the fault was gone. Faults that come again and again trip
  safety's `flapping`, which wants a reset; those resets are the campaign's own and do not count.

{table}
{verdict}
"""


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--repeat", type=int, default=20, help="how often each fault is tried")
    parser.add_argument(
        "--only", action="append", metavar="TEXT", help="faults named so; repeatable"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="where the document goes")
    return parser


if __name__ == "__main__":
    sys.exit(main())
