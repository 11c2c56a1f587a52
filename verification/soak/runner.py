"""Runs the soak: injects and removes faults, and records all observations."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec

from cli.run.supervisor import Child, Supervisor
from common import clock, keys
from common.bus.bus import Arrival, Bus
from common.errors import LinkError, MessageError
from common.freshness import NS_PER_S
from common.messages import Health
from sim import trace as t
from sim.requests import Asked
from sim.sockets import Control
from verification.harness.process_stats import GONE, PROC, stat, tree
from verification.harness.trace import Tail, moves
from verification.soak.faults import Fault, Faults
from verification.soak.record import Life, Progress, Record, Sample, Window
from verification.soak.verdict import too_late

FIRST_S = 10.0  # without faults, so that a lap begins
HANG_S = 0.2  # without a heartbeat the guard kills its child
DRIVER_EVENTS = ("step", "lap finished", "begun anew")


def sample_process(name: str, pid: int, at_s: float) -> tuple[Life, Sample] | None:
    """Return a sample of a process; None when it does not run any more."""
    try:
        now = stat(pid)
        descriptors = sum(1 for _ in (PROC / str(pid) / "fd").iterdir())
    except GONE:
        return None
    if now.state in "ZX":
        return None
    return Life(name, pid, now.started), Sample(at_s, now.rss, now.threads, descriptors)


class SoakRunner:
    """One running soak; all methods run in the loop's thread."""

    def __init__(
        self,
        supervisor: Supervisor,
        control: Control,
        record: Record,
        *,
        files: tuple[Path, Path],  # log and trace
        seed: int,
        budget_s: float,  # from a fault to the last moving command
        report: Callable[[str], None],
        take_lateness_s: Callable[[], float],
    ) -> None:
        self._children = {child.name: child for child in supervisor.children}
        self._control, self._record, self._report = control, record, report
        self._take_lateness_s = take_lateness_s
        self._log, self._trace = map(Tail, files)
        self._faults = Faults(seed)
        self._fault: Fault | None = None
        self._held: Child | None = None  # not restarted until the fault is over
        self._budget_s = budget_s
        self._began_ns = clock.now_ns()
        self._next_ns = self._began_ns + round(FIRST_S * NS_PER_S)
        self._since_ns = 0
        self._end_ns = 0
        self._late_s = 0.0  # largest since the fault began
        self._runs: list[t.Command] = []  # moving commands since the fault began
        self._seen: dict[str, int] = {}  # pids by name
        self._doomed: set[int] = set()  # pids that were killed on purpose

    def subscribe(self, bus: Bus) -> None:
        """Record health messages."""

        def take(arrival: Arrival[Health]) -> None:
            times = self._record.health.setdefault(arrival.message.service, [])
            times.append(self._at_s(arrival.received_ns))

        bus.subscribe(keys.HEALTH, take, depth=16, service="*")

    # --- faults -------------------------------------------------------------------------------

    def disturb(self, now_ns: int, kills: bool) -> None:
        """Begin the next fault, or end the current one, when it is due."""
        if self._fault is None and now_ns >= self._next_ns:
            self._begin(self._faults.next(kills), now_ns)
        elif self._fault is not None and now_ns >= self._end_ns:
            self._finish(self._fault, now_ns)

    def _begin(self, fault: Fault, now_ns: int) -> None:
        if fault.begin is not None and not self._do(fault.begin):
            return
        since_ns = clock.now_ns()
        name, held = self._kill(fault.kills) if fault.kills else (fault.name, True)
        fault = replace(fault, name=name, still=fault.still and held)
        seconds = fault.seconds + (self._budget_s if fault.still else 0.0)
        self._update_lateness()
        self._read_trace()
        self._fault, self._runs, self._late_s = fault, [], 0.0
        self._since_ns, self._end_ns = since_ns, since_ns + round(seconds * NS_PER_S)
        self._record.faults.append((self._at_s(since_ns), name))
        self._report(f"{name}, {seconds:.1f} s")

    def _finish(self, fault: Fault, now_ns: int) -> None:
        if fault.still and self._end_ns:
            self._judge(fault)
            self._end_ns = 0  # judged only once, also when the request below is retried
        if fault.end is not None and not self._do(fault.end):
            return  # the next call tries again
        if self._held is not None:
            self._held.due_s = 0.0
            self._held = None
        self._fault, self._next_ns = None, now_ns + round(self._faults.pause_s() * NS_PER_S)

    def _judge(self, fault: Fault) -> None:
        """Record commands that moved the vehicle although it had to stand.

        Stalls of the host extend the budget. After the fault is removed the vehicle may move again.
        """
        self._update_lateness()
        self._read_trace()
        from_ns = self._since_ns + round((self._budget_s + self._late_s) * NS_PER_S)
        window = Window(fault.name, from_ns, clock.now_ns())
        self._record.windows.append(window)
        self._record.moved += too_late(self._runs, window)

    def _do(self, request: Asked) -> bool:
        try:
            self._control.do(request)
        except (LinkError, MessageError) as error:
            self._report(f"the simulator refuses: {error}")
            return False
        return True

    def _kill(self, service: str) -> tuple[str, bool]:
        """Kill one of a service's processes; return its name, and whether it stays dead."""
        child = self._children[service]
        if child.process is None:
            return f"{service} does not run", False
        processes = list(tree(service, child.process.pid))
        name, pid = processes[self._faults.one_of(len(processes))]
        os.kill(pid, signal.SIGKILL)
        # Orphans end as well.
        self._doomed |= {one for gone, one in processes if gone.startswith(name)}
        if pid != child.process.pid:
            return f"kill {name}", False  # its parent restarts it
        child.process.wait()
        child.process, child.due_s = None, float("inf")
        self._held = child
        return f"kill {name}", True

    # --- observations -------------------------------------------------------------------------

    def sample(self) -> None:
        """Take one sample of all processes and files."""
        record = self._record
        record.seconds = self._at_s(clock.now_ns())
        self._update_lateness()
        pids = self._pids()
        for name, pid in pids:
            found = sample_process(name, pid, record.seconds)
            if found is not None:
                record.lives.setdefault(found[0], []).append(found[1])
        self._read_log()
        self._read_trace()
        self._count_crashes(dict(pids))

    def _pids(self) -> list[tuple[str, int]]:
        running = [(c.name, c.process.pid) for c in self._children.values() if c.process]
        return [one for name, pid in running for one in tree(name, pid)]

    def _read_log(self) -> None:
        record = self._record
        for line in self._log.read().splitlines():
            if b"Traceback" in line:
                record.tracebacks += 1
            if b'"service": "driver"' in line:
                self._log_driver_event(line)
        record.log.append((record.seconds, self._log.bytes))

    def _log_driver_event(self, line: bytes) -> None:
        event = msgspec.json.decode(line, type=dict[str, object])
        what = str(event["event"])
        if what in DRIVER_EVENTS:
            self._record.progress.append(Progress(self._record.seconds, what))
        if what in DRIVER_EVENTS[1:]:
            self._report(f"{what} {event.get('stuck', '')} {event.get('why', '')}".strip())

    def _read_trace(self) -> None:
        lines = t.read(self._trace.read())
        if self._fault is not None:
            self._runs += [line for line in lines if isinstance(line, t.Command) and moves(line)]

    def _update_lateness(self) -> None:
        """Update the lateness of this loop, a measure of the host's stalls."""
        late_s = self._take_lateness_s()
        self._late_s = max(self._late_s, late_s)
        self._record.late_s = max(self._record.late_s, late_s)

    def _count_crashes(self, now: dict[str, int]) -> None:
        """Record processes that disappeared within the last second and were not killed on purpose.

        A guard kills a process that hangs. A kill during a stall of the host is not a crash.
        """
        hung = self._late_s > HANG_S
        for name, pid in self._seen.items():
            if now.get(name) == pid or pid in self._doomed:
                continue
            if not (hung and "/" in name):
                self._record.crashes.append(name)
                self._report(f"{name} has crashed")
        self._seen = now

    def _at_s(self, now_ns: int) -> float:
        return (now_ns - self._began_ns) / NS_PER_S
