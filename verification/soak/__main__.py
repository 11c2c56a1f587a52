"""``python -m verification.soak``: laps with random faults and SIGKILL, and resource usage."""

import argparse
import os
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from random import Random

import msgspec

from cli.settings import Everything
from common import child_process, clock
from common.errors import LinkError, MessageError
from common.freshness import NS_PER_S
from sim.requests import Asked
from verification.harness.bus import set_options
from verification.harness.host import StallRecorder
from verification.harness.process_stats import GONE, PROC, stat, tree
from verification.harness.results import table
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import Tail
from verification.harness.waiting import wait_until
from verification.soak.faults import Fault, faults
from verification.soak.verdict import Record, Sample, results

FIRST_S = 10.0  # without faults, so that a lap begins
PAUSE_S = (3.0, 7.0)  # between the end of a fault and the next one
KILLS_PART = 0.4  # of the time; afterwards every process lives long enough to be judged
HANG_S = 0.2  # without a heartbeat the guard kills its child
PATIENCE_S = 60.0  # until a restarted simulator takes requests


class Soak:
    """Injects faults into a running stack, and records all observations."""

    def __init__(
        self, stack: RunningStack, stalls: StallRecorder, record: Record, seed: int
    ) -> None:
        self._stack, self._stalls, self._record = stack, stalls, record
        self._faults, self._random = faults(Random(seed)), Random(seed)
        self._log = Tail(stack.log)
        self._began_s = time.monotonic()
        self._seen: dict[str, int] = {}  # pids by name
        self._doomed: set[int] = set()  # pids that were killed on purpose
        self._held = ""  # the process that stays dead until the fault is over

    def run(self, seconds: float) -> None:
        """Inject faults until the time is over."""
        self._wait(FIRST_S)
        while (past_s := self._at_s()) < seconds:
            kills = past_s < KILLS_PART * seconds
            self.inject(next(fault for fault in self._faults if kills or not fault.kills))
            self._wait(self._random.uniform(*PAUSE_S))

    def inject(self, fault: Fault) -> None:
        """Begin a fault, wait, and remove it."""
        print(f"{self._at_s():7.1f} s  {fault.name}, {fault.seconds:.1f} s", flush=True)
        self._record.faults += 1
        if fault.begin is not None:
            self._request(fault.begin)
        if fault.kills:
            self._kill(fault.kills)
        self._wait(fault.seconds)
        if fault.end is not None:
            self._request(fault.end)
        if self._held:
            self._stack.start(self._held)
            self._held = ""

    def _request(self, request: Asked) -> None:
        """Send a request to the simulated vehicle until it is taken."""

        def taken() -> bool:
            try:
                self._stack.control.do(request)
            except (LinkError, MessageError):
                self._wait(0.1)
                return False
            return True

        wait_until(taken, f"the simulator takes {request}", PATIENCE_S)

    def _kill(self, name: str) -> None:
        """Kill a process; its parent restarts it, or the end of the fault."""
        pid = wait_until(lambda: self._pids().get(name, 0), f"{name} to kill", PATIENCE_S)
        # Orphans end as well.
        self._doomed |= {one for child, one in self._pids().items() if child.startswith(name)}
        if name in self._stack.processes:
            self._held = name
        os.kill(pid, signal.SIGKILL)

    def _wait(self, seconds: float) -> None:
        """Sample once a second meanwhile."""
        end_s = self._at_s() + seconds
        while (now_s := self._at_s()) < end_s:
            if now_s - self._record.seconds >= 1.0:
                self.sample()
            time.sleep(0.05)

    def _pids(self) -> dict[str, int]:
        """Return all living processes, the children of services included."""
        return {
            name: pid
            for service, process in self._stack.processes.items()
            if process.poll() is None
            for name, pid in tree(service, process.pid)
        }

    def sample(self) -> None:
        """Take one sample of all processes and of the log."""
        record = self._record
        record.seconds = self._at_s()
        pids = self._pids()
        for name, pid in pids.items():
            self._sample_process(name, pid)
        self._find_crashes(pids)
        for line in self._log.read().splitlines():
            self._take_line(line)
        record.log_bytes = self._log.bytes

    def _sample_process(self, name: str, pid: int) -> None:
        try:
            now = stat(pid)
            descriptors = sum(1 for _ in (PROC / str(pid) / "fd").iterdir())
        except GONE:
            return
        if now.state not in "ZX":
            samples = self._record.lives.setdefault((name, pid), [])
            samples.append(Sample(self._record.seconds, now.rss, now.threads, descriptors))

    def _find_crashes(self, pids: dict[str, int]) -> None:
        """Record processes that disappeared without a kill of the soak.

        A guard kills a child that hangs: during a stall of the host that is no crash.
        """
        hung = self._stalls.worst_s(clock.now_ns() - 2 * NS_PER_S, 2.0) > HANG_S
        for name, pid in self._seen.items():
            gone = pids.get(name) != pid and pid not in self._doomed
            if gone and not (hung and "/" in name):
                self._record.crashes.append(name)
                print(f"{name} has crashed", flush=True)
        self._seen = pids
        for name in self._stack.processes.keys() - pids.keys() - {self._held}:
            self._stack.start(name)

    def _take_line(self, line: bytes) -> None:
        self._record.tracebacks += b"Traceback" in line
        if b'"service": "driver"' in line:
            event = msgspec.json.decode(line, type=dict[str, object])
            self._record.events.append((self._record.seconds, str(event["event"])))

    def _at_s(self) -> float:
        return time.monotonic() - self._began_s


def main() -> int:
    """Run the soak and print the results; return 0 when all are good."""
    parser = argparse.ArgumentParser(prog="python -m verification.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="duration, 30")
    parser.add_argument("--seed", type=int, default=1, help="seed of the faults, 1")
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
        soak(options.out, record, options.seed, options.minutes * 60)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    rows = [(what, text, "ok" if fine else "WRONG") for what, text, fine in results(record)]
    print(table(("result", "value", ""), rows))
    return int(any(mark == "WRONG" for *_, mark in rows))


def soak(out: Path, record: Record, seed: int, seconds: float) -> None:
    """Run the stack and the driver of laps, and disturb them."""

    def driver(config: Everything) -> Mapping[str, list[str]]:
        where = set_options(
            f"bus.connect={config.bus.endpoints[0]}", f"sim.control_port={config.sim.control_port}"
        )
        return {"driver": list(child_process.command("verification.soak.driver", *where))}

    with StallRecorder() as stalls, running_stack(out, "office", beside=driver) as stack:
        Soak(stack, stalls, record, seed).run(seconds)


if __name__ == "__main__":
    sys.exit(main())
