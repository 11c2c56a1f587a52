"""``python -m verification.faults``: every fault of the catalogue, again and again, as a table."""

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

from verification.faults.catalogue import FAULTS, PARTS, Fault
from verification.faults.machine import HoldUps
from verification.faults.namespaces import Need, enter, missing
from verification.faults.stack_fixture import Lane, lane
from verification.faults.table import Row, markdown, renewed, verdict
from verification.faults.trial import tried

Queues = dict[Need, deque[Fault]]

# What each lane of a part stands on, one after the other. A trial waits most of the time: a core
# bears two of them. With four, stacks hold each other up for longer than they may.
CORES = max(2, os.cpu_count() or 2)
PLAIN: Sequence[Need] = ["nothing"]
LANES: Sequence[Sequence[Sequence[Need]]] = [
    [["nothing", "other clocks"]],
    [PLAIN] * CORES,
    [
        ["a far driver", "nothing"],
        ["a far driver", "nothing"],
        ["a small disk", "nothing"],
        ["a teleop", "nothing"],
        *[PLAIN] * 2 * (CORES - 2),
    ],
]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign; return 1 when a row is not as it should be."""
    parser = _arguments()
    options = parser.parse_args(argv)
    faults = [f for f in FAULTS if not options.only or any(o in f.name for o in options.only)]
    if not faults:
        names = "\n  ".join(fault.name for fault in FAULTS)
        parser.error(f"no fault is named {' or '.join(options.only)}; there are:\n  {names}")
    lacking = missing(enter())
    left_out = [
        f"{fault.name}: {lacking[fault.needs]}" for fault in faults if fault.needs in lacking
    ]
    faults = [fault for fault in faults if fault.needs not in lacking]
    started_s = time.monotonic()
    with HoldUps() as holdups, tempfile.TemporaryDirectory() as folder:
        rows = campaign(faults, options.repeat, Path(folder), holdups)
    took_s = time.monotonic() - started_s
    text = report(rows, left_out, took_s)
    print(text)
    if options.out:
        again = options.only and options.out.exists()
        old = options.out.read_text(encoding="utf-8") if again else ""
        options.out.write_text(renewed(old, rows, today()) if old else text, encoding="utf-8")
    for row in rows:
        for fault in row.faults[:3]:
            print(f"{row.name}: {fault}", file=sys.stderr)
    return int(any(row.faults for row in rows))


def campaign(faults: Sequence[Fault], repeat: int, folder: Path, holdups: HoldUps) -> list[Row]:
    """Try one part after the other, each on lanes of its own."""
    rows: dict[str, Row] = {}

    def work(queues: Queues, needs: Sequence[Need], name: str) -> None:
        for need in needs:
            if queues[need]:
                _drive(folder / f"{name} {need}".replace(" ", "-"), queues[need], need)

    def _drive(room: Path, queue: deque[Fault], need: Need) -> None:
        room.mkdir()
        (room / "lane.toml").write_text("")
        with lane(room, need=need) as it:
            while (fault := _next(queue)) is not None:
                row = _row(it, fault, repeat, holdups)
                rows[row.name] = row
                print(markdown([row]).splitlines()[-1], file=sys.stderr, flush=True)

    for number, (part, lanes) in enumerate(zip(PARTS, LANES, strict=True)):
        queues = _queues(fault for fault in faults if fault in part)
        with ThreadPoolExecutor(len(lanes)) as pool:
            jobs = [
                pool.submit(work, queues, needs, f"{number}-{n}") for n, needs in enumerate(lanes)
            ]
            for job in jobs:
                job.result()
    return [rows[fault.name] for fault in faults]


def _queues(faults: Iterable[Fault]) -> Queues:
    queues: Queues = defaultdict(deque)
    for fault in faults:
        queues["nothing" if fault.needs == "a memory group" else fault.needs].append(fault)
    return queues


def _next(queue: deque[Fault]) -> Fault | None:
    try:
        return queue.popleft()
    except IndexError:  # another lane was faster
        return None


def _row(it: Lane, fault: Fault, repeat: int, holdups: HoldUps) -> Row:
    samples = [tried(it, fault) for _ in range(repeat)]
    budget_s = fault.budget(it.stack.config) if fault.budget else None
    held = [holdups.worst_s(s.fault_ns, fault.hold_s) for s in samples]
    return Row(fault.name, budget_s, fault.outcome, samples, held)


def report(rows: Sequence[Row], left_out: Sequence[str], took_s: float) -> str:
    """Return the campaign as a document."""
    return TEXT.format(
        date=today(),
        machine=f"{platform.machine()}, {os.cpu_count()} cores, Linux {platform.release()}",
        python=platform.python_version(),
        minutes=round(took_s / 60),
        table=markdown(rows),
        left_out="".join(f"\nLeft out: {one}.\n" for one in left_out),
        verdict=verdict([row.name for row in rows if row.faults]),
    )


def today() -> str:
    """Return the date, UTC."""
    return f"{datetime.now(UTC):%Y-%m-%d}"


TEXT = """# Faults

Made by `make faults` on {date}: {machine}, Python {python}, {minutes} minutes.

After this page you know how fast the vehicle stops after each fault. `make faults` repeats
the campaign.

The campaign uses real processes, real UDP and the simulated board, at 0.8 m/s on an empty
plain with the stick held.

- *p50, p99, worst*: from the fault to the last motion command that the board received, or to the
  first STOP or BRAKE (BREAK in the manual) if that came later.
- *held up*: the longest scheduling stall of the host during a sample, measured by a process that
  only sleeps. With SIGKILL it includes the time that the kernel took to end the process: others
  detect the end by its pipes, which are closed last. A sample may exceed its budget by this time.
- Network, disk and mounts belong to the campaign and need root. Faults that cannot be injected
  here are listed below the table.
- *then*: what was needed to drive again after the fault. Repeated faults trip safety's
  `flapping`, which needs a reset; the campaign makes these resets itself and does not count them.

{table}{left_out}
{verdict}
"""


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--repeat", type=int, default=20, help="how often each fault is tried")
    parser.add_argument(
        "--only", action="append", metavar="TEXT", help="faults named so; repeatable"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE",
        help="where the document goes; with --only, just these rows of it are made anew",
    )  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())
