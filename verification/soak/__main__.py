"""``python -m verification.soak``: random faults of the catalogue for hours, and resource usage."""

import argparse
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

from verification.faults.catalogue import BOARD, PROCESSES
from verification.faults.fault import Fault, run_row
from verification.faults.stack_fixture import StackFixture, stack_fixture
from verification.harness.host import StallRecorder
from verification.harness.process_stats import GONE, PROC, stat, tree
from verification.harness.results import table
from verification.soak.verdict import Record, Sample, results

KILLS_PART = 0.4  # of the time; afterwards every process lives long enough to be judged
HANG_S = 0.2  # without a pulse the guard kills its child


def in_rounds(faults: Sequence[Fault], random: Random) -> Iterator[Fault]:
    """Yield faults without end: each once, in random order, then all of them again."""
    while True:
        yield from random.sample(faults, len(faults))


def soak(
    fixture: StackFixture, stalls: StallRecorder, record: Record, seed: int, seconds: float
) -> None:
    """Try faults until the time is over: of the processes, later of the board."""
    began_s, random = time.monotonic(), Random(seed)
    killing = in_rounds([fault for fault in PROCESSES if fault.needs == "none"], random)
    sparing = in_rounds(BOARD, random)
    while record.seconds < seconds:
        kills = record.seconds < KILLS_PART * seconds
        fault, before = next(killing if kills else sparing), pids(fixture)
        row = run_row(fixture, fault, stalls)
        record.seconds = time.monotonic() - began_s
        print(f"{record.seconds:7.1f} s  {fault.name}", *row.violations, sep="\n", flush=True)
        record.faults += 1
        record.violations += [f"{fault.name}: {violation}" for violation in row.violations]
        after = pids(fixture)
        # A guard kills a child that hangs: during a stall of the host that is no crash.
        if not kills and max(row.stalls_s) < HANG_S:
            record.crashes += [name for name, pid in before.items() if after.get(name) != pid]
        for name, pid in after.items():
            sample(record, name, pid)


def pids(fixture: StackFixture) -> dict[str, int]:
    """Return all living processes, the children of services included."""
    return {
        name: pid
        for service, process in fixture.running.processes.items()
        if process.poll() is None
        for name, pid in tree(service, process.pid)
    }


def sample(record: Record, name: str, pid: int) -> None:
    """Record the resources of a process."""
    try:
        now = stat(pid)
        descriptors = sum(1 for _ in (PROC / str(pid) / "fd").iterdir())
    except GONE:
        return
    if now.state not in "ZX":
        taken = Sample(record.seconds, now.rss, now.threads, descriptors)
        record.lives.setdefault((name, pid), []).append(taken)


def main() -> int:
    """Run the soak and print the results; return 0 when all are good."""
    parser = argparse.ArgumentParser(prog="python -m verification.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="duration, 30")
    parser.add_argument("--seed", type=int, default=1, help="seed of the order, 1")
    parser.add_argument(
        "--out", type=Path, default=Path("out/soak"), help="folder for log and trace"
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for old in options.out.glob("*.jsonl"):
        old.unlink()
    record = Record()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with StallRecorder() as stalls, stack_fixture(options.out) as fixture:
            soak(fixture, stalls, record, options.seed, options.minutes * 60)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    log = (options.out / "log.jsonl").read_bytes()
    record.log_bytes, record.tracebacks = len(log), log.count(b"Traceback")
    rows = [(what, text, "ok" if fine else "WRONG") for what, text, fine in results(record)]
    print(table(("result", "value", ""), rows))
    return int(any(mark == "WRONG" for *_, mark in rows))


if __name__ == "__main__":
    sys.exit(main())
