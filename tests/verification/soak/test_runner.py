"""Faults done to a made-up vehicle and to real processes, and what is recorded of them."""

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import msgspec
import pytest

from cli.run.supervisor import Supervisor
from common import clock
from common.errors import LinkError
from common.freshness import NS_PER_S
from common.motion import Command
from sim import trace as t
from sim.requests import Asked, Driver
from sim.sockets import Control
from tests.cli.processes import alive, wait_gone
from verification.harness.process_stats import tree
from verification.harness.waiting import wait_until
from verification.soak.faults import Fault
from verification.soak.record import Progress, Record
from verification.soak.runner import FIRST_S, SoakRunner

FAULT_BIT, NO_FAULT = Driver(side="left", bits=1), Driver(side="left", bits=0)
DRIVER_FAULT = Fault("driver fault", 0.0, FAULT_BIT, NO_FAULT, still=True)
KILL = Fault("kill safety", 0.0, kills="safety", still=True)
PARENT = ["sh", "-c", "sleep 1000 & wait"]


class Vehicle:
    """The simulator's control socket, made up."""

    def __init__(self) -> None:
        self.done: list[Asked] = []
        self.there = True

    def do(self, request: Asked) -> None:
        if not self.there:
            raise LinkError("the simulator's control socket: timed out")
        self.done.append(request)


class SoakFixture:
    """A soak with one supervised process and chosen faults."""

    def __init__(self, folder: Path, command: list[str], seed: int = 1) -> None:
        self.log, self.trace = folder / "log", folder / "trace"
        self.supervisor = Supervisor([("safety", command)])
        self.child = self.supervisor.children[0]
        self.vehicle, self.record = Vehicle(), Record()
        self.reports: list[str] = []
        self.late_s = 0.0
        self.runner = SoakRunner(
            self.supervisor, cast("Control", self.vehicle), self.record,
            files=(self.log, self.trace), seed=seed, budget_s=0.0,
            report=self.reports.append, take_lateness_s=lambda: self.late_s,
        )  # fmt: skip
        self.supervisor.look(0.0)

    def begin(self, fault: Fault) -> None:
        """Select this fault as the next one, and begin it."""
        self.runner._faults.next = lambda kills: fault  # type: ignore[method-assign]
        self.runner.disturb(clock.now_ns() + round(FIRST_S * NS_PER_S), kills=True)

    def finish(self) -> None:
        self.runner.disturb(clock.now_ns() + NS_PER_S, kills=True)

    def runs(self) -> None:
        """Append a motion command to the trace of the board, dated now."""
        line = t.Command(mono_ns=clock.now_ns(), kind=Command.RUN, linear=0.5, angular=0.0)
        with self.trace.open("ab") as file:
            file.write(msgspec.json.encode(line) + b"\n")

    def pid(self) -> int:
        assert self.child.process is not None
        return self.child.process.pid


@pytest.fixture
def soak(tmp_path: Path) -> Iterator[SoakFixture]:
    it = SoakFixture(tmp_path, ["sleep", "1000"])
    yield it
    it.supervisor.end()


def test_a_fault_is_done_and_undone(soak: SoakFixture) -> None:
    soak.runner.disturb(clock.now_ns(), kills=True)
    assert soak.record.faults == [], "not before its time"
    soak.begin(DRIVER_FAULT)
    assert soak.vehicle.done == [FAULT_BIT]
    soak.finish()
    assert soak.vehicle.done == [FAULT_BIT, NO_FAULT]
    assert [name for _, name in soak.record.faults] == ["driver fault"]
    assert soak.reports == ["driver fault, 0.0 s"]
    soak.finish()
    assert soak.vehicle.done == [FAULT_BIT, NO_FAULT], "no fault for a while"


def test_what_the_vehicle_does_not_take_is_tried_again(soak: SoakFixture) -> None:
    soak.vehicle.there = False
    soak.begin(DRIVER_FAULT)
    assert soak.record.faults == []
    assert "timed out" in soak.reports[0]
    soak.vehicle.there = True
    soak.begin(DRIVER_FAULT)
    soak.vehicle.there = False
    soak.finish()
    soak.vehicle.there = True
    soak.finish()
    assert soak.vehicle.done == [FAULT_BIT, NO_FAULT]
    assert len(soak.record.windows) == 1


def test_a_killed_service_is_left_dead_and_then_started(soak: SoakFixture) -> None:
    first = soak.pid()
    soak.runner.sample()
    soak.begin(KILL)
    soak.runner.sample()
    wait_gone([first])
    soak.supervisor.look(time.monotonic())
    assert soak.child.process is None
    soak.finish()
    soak.supervisor.look(time.monotonic())
    assert alive(soak.pid())
    soak.runner.sample()
    assert soak.record.crashes == []


def test_of_a_service_with_a_child_either_is_killed(tmp_path: Path) -> None:
    killed: set[str] = set()
    for attempt in range(40):
        if len(killed) == 2:
            break
        with with_a_child(tmp_path, attempt) as soak:
            soak.runner.sample()
            soak.begin(KILL)
            killed |= {name for _, name in soak.record.faults}
            assert (soak.child.process is None) == soak.reports[0].startswith("kill safety,")
            soak.runner.sample()
            assert soak.record.crashes == []
            assert soak.runner._fault is not None
            assert soak.runner._fault.still == (soak.child.process is None)
    assert killed == {"kill safety", "kill safety/1"}


def test_a_child_that_is_killed_is_no_crash_however_long_it_takes_to_end(tmp_path: Path) -> None:
    with with_a_child(tmp_path, 1) as soak:
        soak.runner.sample()
        soak.runner._faults.one_of = lambda count: count - 1  # type: ignore[method-assign]
        (_, (_, child)) = tree("safety", soak.pid())
        os.kill(soak.pid(), signal.SIGSTOP)  # a stopped process does not reap its child
        soak.begin(KILL)
        soak.runner.sample()
        assert ("safety/1", child) in tree("safety", soak.pid())
        os.kill(soak.pid(), signal.SIGCONT)
        wait_until(lambda: ("safety/1", child) not in tree("safety", soak.pid()), "it is reaped")
        soak.runner.sample()
        assert soak.record.crashes == []


@contextlib.contextmanager
def with_a_child(folder: Path, seed: int) -> Iterator[SoakFixture]:
    soak = SoakFixture(folder, PARENT, seed)
    wait_until(lambda: len(list(tree("safety", soak.pid()))) == 2, "the child")
    pids = [pid for _, pid in tree("safety", soak.pid())]
    try:
        yield soak
    finally:
        soak.supervisor.end()
        for pid in filter(alive, pids):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        wait_gone(pids)


@pytest.mark.parametrize("fault", [DRIVER_FAULT, KILL])
def test_a_run_before_the_fault_is_none_of_it(soak: SoakFixture, fault: Fault) -> None:
    soak.runs()
    soak.begin(fault)
    soak.finish()
    assert soak.record.moved == []


@pytest.mark.parametrize(("late_s", "count"), [(0.0, 1), (60.0, 0)])
def test_a_run_while_it_must_stand_is_noticed_but_for_the_machines_own_lateness(
    soak: SoakFixture, late_s: float, count: int
) -> None:
    soak.begin(DRIVER_FAULT)
    soak.runs()
    soak.late_s = late_s
    soak.finish()
    assert len(soak.record.moved) == count
    assert soak.record.late_s == late_s


def test_all_that_can_be_seen_is_recorded(soak: SoakFixture) -> None:
    soak.log.write_bytes(
        b'{"service": "driver", "event": "step", "name": "back off"}\n'
        b'{"service": "driver", "event": "started"}\n'
        b'{"service": "odom", "event": "step"}\n'
        b'{"service": "driver", "event": "begun anew", "stuck": "release", "why": "hit"}\n'
        b"Traceback (most recent call last):\n"
    )
    soak.runner.sample()
    record = soak.record
    assert [one.what for one in record.progress] == ["step", "begun anew"]
    assert isinstance(record.progress[0], Progress)
    assert record.tracebacks == 1
    assert record.log[0][1] == soak.log.stat().st_size
    assert {process.name for process in record.lives} == {"safety"}
    assert soak.reports == ["begun anew release hit"]


def test_a_crash_of_its_own_is_recorded(soak: SoakFixture) -> None:
    soak.runner.sample()
    assert soak.child.process is not None
    soak.child.process.kill()
    soak.child.process.wait()
    soak.supervisor.look(1.0)
    soak.runner.sample()
    soak.supervisor.look(1.0)
    soak.runner.sample()
    assert soak.record.crashes == ["safety"]


@pytest.mark.parametrize(("late_s", "crashes"), [(0.0, ["safety/1"]), (0.5, [])])
def test_a_child_that_is_lost_while_the_machine_hangs_is_no_crash(
    tmp_path: Path, late_s: float, crashes: list[str]
) -> None:
    with with_a_child(tmp_path, 1) as soak:
        soak.runner.sample()
        (_, (_, child)) = tree("safety", soak.pid())
        os.kill(child, signal.SIGKILL)
        wait_until(lambda: ("safety/1", child) not in tree("safety", soak.pid()), "it is reaped")
        soak.late_s = late_s
        soak.runner.sample()
        assert soak.record.crashes == crashes
