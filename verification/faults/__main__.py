"""``python -m verification.faults``: inject every fault repeatedly and print a table."""

import argparse
import os
import platform
import sys
import tempfile
import time
from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

from verification.faults import black_box
from verification.faults.black_box_scenarios import SCENARIOS
from verification.faults.catalogue import FAULTS, GROUPS
from verification.faults.fault import Fault
from verification.faults.namespaces import Requirement, enter, missing
from verification.faults.stack_fixture import StackFixture, stack_fixture
from verification.faults.table import Row, markdown, renewed, verdict
from verification.faults.trial import run_trial
from verification.harness.host import StallRecorder, short_description
from verification.harness.stack import SETTINGS_FILE

Queues = dict[Requirement, deque[Fault]]

# Requirements of the parallel stacks of each group, in sequence. A trial waits most of the time: a
# core can run two stacks. Four stacks per core would stall each other beyond the limits.
CORES = max(2, os.cpu_count() or 2)
NONE: Sequence[Requirement] = ["none"]
STACKS: Sequence[Sequence[Sequence[Requirement]]] = [
    [["none", "separate clocks"]],
    [NONE] * CORES,
    [
        ["remote driver", "none"],
        ["remote driver", "none"],
        ["small disk", "third parties", "none"],
        ["teleop", "relay", "none"],
        *[NONE] * 2 * (CORES - 2),
    ],
]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign; return 1 when a row is outside its limits."""
    parser = _arguments()
    options = parser.parse_args(argv)
    faults = [f for f in FAULTS if not options.only or any(o in f.name for o in options.only)]
    scenarios = [s for s in SCENARIOS if not options.only or any(o in s.name for o in options.only)]
    if not faults and not scenarios:
        names = "\n  ".join([*(f.name for f in FAULTS), *(s.name for s in SCENARIOS)])
        parser.error(f"no fault is named {' or '.join(options.only)}; there are:\n  {names}")
    lacking = missing(enter())
    left_out = [
        f"{fault.name}: {lacking[fault.needs]}" for fault in faults if fault.needs in lacking
    ]
    faults = [fault for fault in faults if fault.needs not in lacking]
    started_s = time.monotonic()
    with StallRecorder() as stalls, tempfile.TemporaryDirectory() as folder:
        rows = campaign(faults, options.repeat, Path(folder), stalls)
        outcomes = [(scenario, black_box.tried(scenario, stalls)) for scenario in scenarios]
    took_s = time.monotonic() - started_s
    text = report(rows, left_out, took_s)
    print(text + black_box.section(outcomes, today()))
    if options.out:
        again = options.only and options.out.exists()
        old = options.out.read_text(encoding="utf-8") if again else ""
        old, heading, old_section = old.partition(black_box.HEADING)
        page = renewed(old, rows, today()) if old and rows else old or text
        page += black_box.section(outcomes, today(), heading + old_section)
        options.out.write_text(page, encoding="utf-8")
    wrong = [(row.name, fault) for row in rows for fault in row.faults[:3]]
    wrong += [(scenario.name, error) for scenario, error in outcomes if error]
    for name, what in wrong:
        print(f"{name}: {what}", file=sys.stderr)
    return int(bool(wrong))


def campaign(
    faults: Sequence[Fault], repeat: int, folder: Path, stalls: StallRecorder
) -> list[Row]:
    """Run one group after the other, each on its own parallel stacks."""
    rows: dict[str, Row] = {}

    def run_stack(queues: Queues, needs: Sequence[Requirement], name: str) -> None:
        for need in needs:
            if queues[need]:
                run_queue(folder / f"{name} {need}".replace(" ", "-"), queues[need], need)

    def run_queue(room: Path, queue: deque[Fault], need: Requirement) -> None:
        room.mkdir()
        (room / SETTINGS_FILE).write_text("")
        with stack_fixture(room, need=need) as it:
            while (fault := _next(queue)) is not None:
                row = _row(it, fault, repeat, stalls)
                rows[row.name] = row
                print(markdown([row]).splitlines()[-1], file=sys.stderr, flush=True)

    for number, (group, stacks) in enumerate(zip(GROUPS, STACKS, strict=True)):
        queues = _queues(fault for fault in faults if fault in group)
        with ThreadPoolExecutor(len(stacks)) as pool:
            jobs = [
                pool.submit(run_stack, queues, needs, f"{number}-{n}")
                for n, needs in enumerate(stacks)
            ]
            for job in jobs:
                job.result()
    return [rows[fault.name] for fault in faults]


def _queues(faults: Iterable[Fault]) -> Queues:
    queues: Queues = defaultdict(deque)
    for fault in faults:
        queues["none" if fault.needs == "memory cgroup" else fault.needs].append(fault)
    return queues


def _next(queue: deque[Fault]) -> Fault | None:
    try:
        return queue.popleft()
    except IndexError:  # another stack took it
        return None


def _row(it: StackFixture, fault: Fault, repeat: int, stalls: StallRecorder) -> Row:
    samples = [run_trial(it, fault) for _ in range(repeat)]
    budget_s = fault.budget(it.running.config) if fault.budget else None
    stalls_s = [stalls.worst_s(s.fault_ns, fault.hold_s) for s in samples]
    return Row(fault.name, budget_s, fault.outcome, samples, stalls_s)


def report(rows: Sequence[Row], left_out: Sequence[str], took_s: float) -> str:
    """Return the document of the campaign."""
    return TEXT.format(
        date=today(),
        machine=short_description(),
        python=platform.python_version(),
        minutes=round(took_s / 60),
        table=markdown(rows),
        left_out="".join(f"\nLeft out: {one}.\n" for one in left_out),
        verdict=verdict([row.name for row in rows if row.faults]),
    )


def today() -> str:
    """Return the date in UTC."""
    return f"{datetime.now(UTC):%Y-%m-%d}"


TEXT = """# Faults

Made by `make faults` on {date}: {machine}, Python {python}, {minutes} minutes.

Real processes, real UDP, the simulated board, 0.8 m/s on an empty plane while motion is requested.

- *p50, p99, worst*: time from the fault to the last command at the board that moves the vehicle, or
  to the first STOP or BRAKE if that is later.
- *stall*: the longest time that the host kept a sleeping process from running during a sample.
  After SIGKILL it includes the time that the kernel took to end the process: other processes detect
  the end by its pipes, which the kernel closes last. A sample may exceed its budget by this time.
- The campaign uses its own network namespace, disk and mounts, which need root. Faults that need
  something that is not available here are listed below the table.
- *then*: what it takes to drive again after the fault. Repeated faults trip safety's `flapping`,
  which needs a reset; these resets belong to the campaign and do not count.

{table}{left_out}
{verdict}
"""


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--repeat", type=int, default=20, help="trials per fault, 20")
    parser.add_argument(
        "--only",
        action="append",
        metavar="TEXT",
        help="only faults whose name contains TEXT; repeatable",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE",
        help="write the document here; with --only replace only these rows",
    )  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())
