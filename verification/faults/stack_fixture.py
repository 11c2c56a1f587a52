"""A running stack with a driver and an operator, on which faults are injected."""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Self

import msgspec

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Done, SafetyState
from common.operator import reset_request
from sim.requests import Bumper, Driver, Firmware, Lose, Mute, Place, Wire
from verification.faults import relay
from verification.faults.namespaces import Requirement, clock, small_disk
from verification.faults.third_party import PARTIES, SETS
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower, moves
from verification.harness.waiting import becomes_true

# Reach the speed sooner. No time limit changes.
QUICK = [
    "safety.unsafe_overrides=linear_acceleration",
    "safety.linear_acceleration=5",
    "sim.drive.acceleration=10",
]
OPEN = ["bus.insecure=true"]  # for a driver on another host, without certificates
ROOM_M = 900.0  # from here the vehicle is put back to the origin
READY_S = 30.0
SPEED_MPS = 0.8  # of every fault
DRIVER = "verification.faults.driver"


class StackFixture:
    """One stack, driven at ``SPEED_MPS``; reads the board's trace and safety's state."""

    def __init__(
        self,
        stack: RunningStack,
        bus: Bus,
        folder: Path,
        driver: Sequence[str],
        env: Mapping[str, str],
    ) -> None:
        self.running = stack
        self._driver, self._env = [sys.executable, "-m", *driver], env
        self.bus = bus
        self.folder = folder
        self.frames = TraceFollower(stack.trace_file)
        self.state: SafetyState | None = None
        self.asked = 0.0
        self.death_s = 0.0  # that the kernel took to end the last killed process
        self.start_driver()

    def start_driver(self) -> None:
        """Start or restart the driver."""
        if "driver" in self.running.processes:
            self.running.processes["driver"].communicate()  # also closes its pipe
        self.running.processes["driver"] = subprocess.Popen(
            self._driver, stdin=subprocess.PIPE, env=self._env
        )
        self.request(self.asked)

    def request(self, speed: float) -> None:
        """Request a speed, m/s."""
        self.asked = speed
        self.send_line(b"%f" % speed)

    def disturb_network(self, faults: Wire) -> None:
        """Disturb the packets between a remote driver and the robot from now on."""
        self.send_line(msgspec.json.encode(faults))

    def send_line(self, line: bytes) -> None:
        """Send a line to the driver process."""
        pipe = self.running.processes["driver"].stdin
        assert pipe is not None
        with contextlib.suppress(OSError):  # the driver may be dead
            pipe.write(line + b"\n")
            pipe.flush()

    def ended(self) -> tuple[str, ...]:
        """Return the processes that have ended."""
        ended = [
            name for name, process in self.running.processes.items() if process.poll() is not None
        ]
        return tuple(ended)

    def restart_ended(self) -> Self:
        """Restart processes that have ended, as a supervisor does."""
        for name in self.ended():
            if name == "driver":
                self.start_driver()
            else:
                self.running.start(name)
        return self

    def moving(self) -> bool:
        """Return whether the board's last command moves the vehicle."""
        self.frames.follow()
        return bool(self.frames.commands) and moves(self.frames.commands[-1])

    def at_speed(self) -> bool:
        """Return whether the board's last command has the requested speed."""
        return self.moving() and self.frames.commands[-1].linear > SPEED_MPS - 0.01

    def neutral(self) -> bool:
        """Return whether the board's last command is RUN with zero speed: neutral was accepted."""
        self.frames.follow()
        last = self.frames.commands[-1:]
        return bool(last) and last[0].kind == "run" and not moves(last[0])

    def latched(self) -> bool:
        """Return whether a reset is due."""
        return self.state is not None and bool(self.state.latched)

    def flapping(self) -> bool:
        """Return whether a reset is due only because of the campaign's repeated faults."""
        return self.state is not None and self.state.latched == ("flapping",)

    def reset(self) -> None:
        """Call safety's reset as the operator."""
        done: list[Done | str] = []
        if self.state is None:
            return
        self.bus.call(keys.RESET, reset_request(self.state), done.append, done.append, 1.0)
        becomes_true(lambda: done, 1.5)

    def rearm(self, patience_s: float) -> bool:
        """Request zero, then the speed again; return whether the vehicle drives."""
        self.request(0.0)
        becomes_true(self.neutral, patience_s)
        self.request(SPEED_MPS)
        return becomes_true(self.at_speed, patience_s)

    def ready(self) -> None:
        """Bring the vehicle to speed; raise AssertionError after ``READY_S``."""
        self.restart_ended().restore()
        if self.at_speed() and not self.latched():
            self.frames.forget()
            return
        end_s = time.monotonic() + READY_S
        while time.monotonic() < end_s:
            self.restart_ended()
            if self.latched():
                self.request(0.0)
                time.sleep(0.1)
                self.reset()
            if self.rearm(2.0):
                self.frames.forget()
                return
        log = self.running.log.read_text()[-2000:]
        raise AssertionError(f"does not drive: {self.state}\n{log}")

    def restore(self) -> None:
        """Remove all faults of the simulated board; put a distant vehicle back to the origin."""
        self.running.control.do(Wire())
        self.running.control.do(Mute())
        self.running.control.do(Firmware())
        self.running.control.do(Lose())
        self.running.control.do(Bumper(pressed=False))
        for side in ("left", "right"):
            self.running.control.do(Driver(side=side, bits=0))
        if abs(self.running.control.truth().x) > ROOM_M:
            self.running.control.do(Place(x=0.0, y=0.0))


@contextlib.contextmanager
def stack_fixture(
    folder: Path, *, shipped: bool = True, need: Requirement = "none"
) -> Iterator[StackFixture]:
    """Run a stack fixture that meets the requirement of a fault."""
    remote, others, clocks, disk, behind = (
        need == one
        for one in ("remote driver", "third parties", "separate clocks", "small disk", "relay")
    )
    with contextlib.ExitStack() as stack:
        if disk:
            stack.enter_context(small_disk(folder / "disk"))
        if behind:
            stack.enter_context(relay.cables())
        made = stack.enter_context(
            running_stack(
                folder, shipped=shipped,
                sets=[*QUICK, *OPEN * remote, *SETS * others, *relay.PC_SETS * behind],
                sim_sets=relay.SIM_SETS if behind else (), beside=relay.command if behind else None,
                log="disk/log.jsonl" if disk else "log.jsonl",
                listen=f"tcp/{'0.0.0.0' if remote else '127.0.0.1'}:{{port}}",
                env=clock(folder / "robot") if clocks else None,
            )
        )  # fmt: skip
        for name in PARTIES if others else ():
            made.commands[name] = [
                sys.executable, "-m", "verification.faults.third_party", name, made.endpoint,
            ]  # fmt: skip
            made.start(name)
        driver = {
            "remote driver": ["verification.faults.remote_host", made.endpoint, DRIVER],
            "teleop": ["verification.faults.keyboard", made.endpoint],
        }.get(need, [DRIVER, made.endpoint])
        env = clock(folder / "driver") if clocks else os.environ
        yield stack.enter_context(driven(made, folder, driver, env))


@contextlib.contextmanager
def driven(
    stack: RunningStack, folder: Path, driver: Sequence[str], env: Mapping[str, str]
) -> Iterator[StackFixture]:
    """Add a driver and an operator to a running stack."""
    with running(Loop()) as loop:
        it: list[StackFixture] = []

        def take(arrival: Arrival[SafetyState]) -> None:
            if it:
                it[0].state = arrival.message

        with bus_on(stack.endpoint, loop, lambda bus: bus.subscribe(keys.SAFETY, take)) as bus:
            it.append(StackFixture(stack, bus, folder, driver, env))
            yield it[0]
