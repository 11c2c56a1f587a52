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
from common.errors import LinkError
from common.freshness import NS_PER_S
from common.motion import Command
from sim import trace as t
from sim.control import Control
from sim.requests import Asked, Driver
from tests.cli.processes import alive, wait_gone
from verification.harness.support import wait_until
from verification.soak.faults import Fault
from verification.soak.process_stats import tree
from verification.soak.record import Progress, Record
from verification.soak.runner import FIRST_S, Yard

BROKEN, MENDED = Driver(side="left", bits=1), Driver(side="left", bits=0)
DRIVER_FAULT = Fault("driver fault", 0.0, BROKEN, MENDED, still=True)
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


class Scene:
    """A yard with one supervised process, and the faults that are wanted."""

    def __init__(self, folder: Path, command: list[str], seed: int = 1) -> None:
        self.log, self.trace = folder / "log", folder / "trace"
        self.supervisor = Supervisor([("safety", command)])
        self.child = self.supervisor.children[0]
        self.vehicle, self.record = Vehicle(), Record()
        self.told: list[str] = []
        self.late_s = 0.0
        self.yard = Yard(
            self.supervisor, cast("Control", self.vehicle), self.record,
            files=(self.log, self.trace), seed=seed, budget_s=0.0,
            tell=self.told.append, take_lateness_s=lambda: self.late_s,
        )  # fmt: skip
        self.supervisor.look(0.0)

    def begin(self, fault: Fault) -> None:
        """Let this fault be the next one, and begin it."""
        self.yard._faults.next = lambda kills: fault  # type: ignore[method-assign]
        self.yard.disturb(time.monotonic_ns() + round(FIRST_S * NS_PER_S), kills=True)

    def finish(self) -> None:
        self.yard.disturb(time.monotonic_ns() + NS_PER_S, kills=True)

    def runs(self) -> None:
        """Let the board take a command that moves the vehicle, now."""
        line = t.Command(mono_ns=time.monotonic_ns(), kind=Command.RUN, linear=0.5, angular=0.0)
        with self.trace.open("ab") as file:
            file.write(msgspec.json.encode(line) + b"\n")

    def pid(self) -> int:
        assert self.child.process is not None
        return self.child.process.pid


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    it = Scene(tmp_path, ["sleep", "1000"])
    yield it
    it.supervisor.end()


def test_a_fault_is_done_and_undone(scene: Scene) -> None:
    scene.yard.disturb(time.monotonic_ns(), kills=True)
    assert scene.record.faults == [], "not before its time"
    scene.begin(DRIVER_FAULT)
    assert scene.vehicle.done == [BROKEN]
    scene.finish()
    assert scene.vehicle.done == [BROKEN, MENDED]
    assert [name for _, name in scene.record.faults] == ["driver fault"]
    assert scene.told == ["driver fault, 0.0 s"]
    scene.finish()
    assert scene.vehicle.done == [BROKEN, MENDED], "then all is well for a while"


def test_what_the_vehicle_does_not_take_is_tried_again(scene: Scene) -> None:
    scene.vehicle.there = False
    scene.begin(DRIVER_FAULT)
    assert scene.record.faults == []
    assert "timed out" in scene.told[0]
    scene.vehicle.there = True
    scene.begin(DRIVER_FAULT)
    scene.vehicle.there = False
    scene.finish()
    scene.vehicle.there = True
    scene.finish()
    assert scene.vehicle.done == [BROKEN, MENDED]
    assert len(scene.record.windows) == 1


def test_a_killed_service_is_left_dead_and_then_started(scene: Scene) -> None:
    first = scene.pid()
    scene.yard.watch()
    scene.begin(KILL)
    scene.yard.watch()
    wait_gone([first])
    scene.supervisor.look(time.monotonic())
    assert scene.child.process is None
    scene.finish()
    scene.supervisor.look(time.monotonic())
    assert alive(scene.pid())
    scene.yard.watch()
    assert scene.record.crashes == []


def test_of_a_service_with_a_child_either_is_killed(tmp_path: Path) -> None:
    killed: set[str] = set()
    for attempt in range(40):
        if len(killed) == 2:
            break
        with with_a_child(tmp_path, attempt) as scene:
            scene.yard.watch()
            scene.begin(KILL)
            killed |= {name for _, name in scene.record.faults}
            assert (scene.child.process is None) == scene.told[0].startswith("kill safety,")
            scene.yard.watch()
            assert scene.record.crashes == []
            assert scene.yard._fault is not None
            assert scene.yard._fault.still == (scene.child.process is None)
    assert killed == {"kill safety", "kill safety/1"}


def test_a_child_that_is_killed_is_no_crash_however_long_it_takes_to_end(tmp_path: Path) -> None:
    with with_a_child(tmp_path, 1) as scene:
        scene.yard.watch()
        scene.yard._faults.one_of = lambda count: count - 1  # type: ignore[method-assign]
        (_, (_, child)) = tree("safety", scene.pid())
        os.kill(scene.pid(), signal.SIGSTOP)  # who is stopped does not reap its child
        scene.begin(KILL)
        scene.yard.watch()
        assert ("safety/1", child) in tree("safety", scene.pid())
        os.kill(scene.pid(), signal.SIGCONT)
        wait_until(lambda: ("safety/1", child) not in tree("safety", scene.pid()), "it is reaped")
        scene.yard.watch()
        assert scene.record.crashes == []


@contextlib.contextmanager
def with_a_child(folder: Path, seed: int) -> Iterator[Scene]:
    scene = Scene(folder, PARENT, seed)
    wait_until(lambda: len(list(tree("safety", scene.pid()))) == 2, "the child")
    pids = [pid for _, pid in tree("safety", scene.pid())]
    try:
        yield scene
    finally:
        scene.supervisor.end()
        for pid in filter(alive, pids):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        wait_gone(pids)


@pytest.mark.parametrize("fault", [DRIVER_FAULT, KILL])
def test_a_run_before_the_fault_is_none_of_it(scene: Scene, fault: Fault) -> None:
    scene.runs()
    scene.begin(fault)
    scene.finish()
    assert scene.record.moved == []


@pytest.mark.parametrize(("late_s", "count"), [(0.0, 1), (60.0, 0)])
def test_a_run_while_it_must_stand_is_noticed_but_for_the_machines_own_lateness(
    scene: Scene, late_s: float, count: int
) -> None:
    scene.begin(DRIVER_FAULT)
    scene.runs()
    scene.late_s = late_s
    scene.finish()
    assert len(scene.record.moved) == count
    assert scene.record.late_s == late_s


def test_all_that_can_be_seen_is_recorded(scene: Scene) -> None:
    scene.log.write_bytes(
        b'{"service": "driver", "event": "step", "name": "back off"}\n'
        b'{"service": "driver", "event": "started"}\n'
        b'{"service": "odom", "event": "step"}\n'
        b'{"service": "driver", "event": "begun anew", "stuck": "release", "why": "hit"}\n'
        b"Traceback (most recent call last):\n"
    )
    scene.yard.watch()
    record = scene.record
    assert [one.what for one in record.progress] == ["step", "begun anew"]
    assert isinstance(record.progress[0], Progress)
    assert record.tracebacks == 1
    assert record.log[0][1] == scene.log.stat().st_size
    assert {life.name for life in record.lives} == {"safety"}
    assert scene.told == ["begun anew release hit"]


def test_a_crash_of_its_own_is_recorded(scene: Scene) -> None:
    scene.yard.watch()
    assert scene.child.process is not None
    scene.child.process.kill()
    scene.child.process.wait()
    scene.supervisor.look(1.0)
    scene.yard.watch()
    scene.supervisor.look(1.0)
    scene.yard.watch()
    assert scene.record.crashes == ["safety"]


@pytest.mark.parametrize(("late_s", "crashes"), [(0.0, ["safety/1"]), (0.5, [])])
def test_a_child_that_is_lost_while_the_machine_hangs_is_no_crash(
    tmp_path: Path, late_s: float, crashes: list[str]
) -> None:
    with with_a_child(tmp_path, 1) as scene:
        scene.yard.watch()
        (_, (_, child)) = tree("safety", scene.pid())
        os.kill(child, signal.SIGKILL)
        wait_until(lambda: ("safety/1", child) not in tree("safety", scene.pid()), "it is reaped")
        scene.late_s = late_s
        scene.yard.watch()
        assert scene.record.crashes == crashes
