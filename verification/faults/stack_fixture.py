"""A running stack with a driver and an operator, on which faults are injected."""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Literal, Self

import msgspec

from cli.settings import Everything
from sim.requests import Bumper, Driver, Firmware, Mute, Place, Sonar, Wire
from verification.faults.independent_client import DRIVE, Client, session
from verification.faults.namespaces import (
    RELAY_CABLES,
    RELAY_HOST,
    clock,
    relay_host,
    small_disk,
    step_clock,
)
from verification.harness.ports import free_port
from verification.harness.process_stats import tree
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower, moves
from verification.harness.waiting import becomes_true

# What a fault needs beside or in place of the usual stack.
Requirement = Literal[
    "none", "remote driver", "third parties", "small disk", "separate clocks", "relay", "site",
    "independent board",
]  # fmt: skip
# Reach the speed sooner. No time limit changes.
QUICK = ["unsafe_overrides=safety.linear_acceleration", "safety.linear_acceleration=5"]
QUICK_MOTORS = str(Path(__file__).with_name("quick_motors.toml"))
ROOM_M = 900.0  # from here the vehicle is put back to the origin
READY_S = 60.0  # on a shared host
SPEED_MPS = 0.8  # of every fault
LIMIT_LEASE_S, PENDANT_LEASE_S = 0.5, 1.0
CLOCKS = ("robot", "driver")
NORMAL = (
    Wire(), Mute(), Firmware(), Bumper(pressed=False), Driver(side="left", bits=0),
    Driver(side="right", bits=0), Sonar(name="front"), Sonar(name="rear"),
)  # fmt: skip
MODULE = [sys.executable, "-m"]
SOURCE = "verification.faults.independent_client"
THIRD_PARTIES = {
    "limiter": "@cmd/limit/lidar",  # no restriction
    "pendant": "@cmd/limit/pendant",
}
REMOTE_HOST = "verification.faults.remote_host"
INDEPENDENT_BOARD = "verification.faults.independent_board"
(PC, RELAY_TO_PC), (BOARD, RELAY_TO_BOARD) = RELAY_CABLES.values()
RELAY_PORT = 4010  # of its reports
SIM_BEHIND_RELAY = [
    f"board.address={BOARD}", f"board.listen_address={RELAY_TO_BOARD}", "board.relay_port=0",
]  # fmt: skip


class StackFixture:
    """One stack, driven at ``SPEED_MPS``; reads the board's trace and safety's state."""

    def __init__(self, stack: RunningStack, client: Client) -> None:
        self.running = stack
        self.client = client
        self.frames = TraceFollower(stack.trace_file)
        self.asked = 0.0
        self.death_s = 0.0  # that the kernel took to end the last killed process

    @property
    def folder(self) -> Path:
        """The folder of the stack."""
        return self.running.trace_file.parent

    def request(self, speed: float) -> None:
        """Request a speed, m/s."""
        self.asked = speed
        self.send_line(b"%f" % speed)

    def disturb_network(self, faults: Wire) -> None:
        """Disturb the packets between a remote driver and the robot from now on."""
        self.send_line(msgspec.json.encode(faults))

    def send_line(self, line: bytes, name: str = "driver") -> None:
        """Send a line to a process."""
        pipe = self.running.processes[name].stdin
        assert pipe is not None
        with contextlib.suppress(OSError):  # it may be dead
            pipe.write(line + b"\n")
            pipe.flush()

    def ended(self) -> tuple[str, ...]:
        """Return the processes that have ended."""
        processes = self.running.processes
        return tuple(name for name, process in processes.items() if process.poll() is not None)

    def restart_ended(self) -> Self:
        """Restart processes that have ended, as a supervisor does."""
        for name in self.ended():
            self.running.start(name)
            if name == "driver":
                self.request(self.asked)
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

    def reset(self) -> None:
        """Call safety's reset as the operator."""
        if self.client.state:
            self.client.call("safety/reset", self.client.reset_request())

    def rearm(self, patience_s: float) -> bool:
        """Request zero, then the speed again; return whether the vehicle drives."""
        self.request(0.0)
        becomes_true(self.neutral, patience_s)
        self.request(SPEED_MPS)
        return becomes_true(self.at_speed, patience_s)

    def ready(self) -> None:
        """Bring the vehicle to speed; raise AssertionError after ``READY_S``."""
        self.restart_ended().restore()
        end_s = time.monotonic() + READY_S
        while not self.at_speed() or self.client.latched:
            if time.monotonic() > end_s:
                log = self.running.log.read_text()[-2000:]
                raise AssertionError(f"does not drive: {self.client.state}\n{log}")
            if self.restart_ended().client.latched:
                self.request(0.0)
                time.sleep(0.1)
                self.reset()
            self.rearm(2.0)
        self.frames.forget()

    def restore(self) -> None:
        """Undo all faults but killed processes; put a distant vehicle back to the origin."""
        living = [it.pid for it in self.running.processes.values() if it.poll() is None]
        for _, pid in chain.from_iterable(tree("", pid) for pid in living):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
        while self.running.others:
            process = self.running.others.pop()
            process.terminate()
            process.communicate(timeout=20)
        if REMOTE_HOST in self.running.commands["driver"]:
            self.disturb_network(Wire())
        for clock_file in (self.folder / name for name in CLOCKS):
            if clock_file.exists():
                step_clock(clock_file, 0)
        self._restore_board()

    def _restore_board(self) -> None:
        if INDEPENDENT_BOARD in self.running.commands["sim"]:
            self.send_line(b"normal", "sim")
            return
        for request in NORMAL:
            self.running.control.do(request)
        if abs(self.running.control.truth().x) > ROOM_M:
            self.running.control.do(Place(x=0.0, y=0.0))


def operators_endpoint(config: Everything) -> str:
    """Return the router where operators connect: the site's if there is one."""
    return (*config.bus.uplink, *config.bus.endpoints)[0]


def _settings(need: Requirement) -> list[str]:
    """Return the settings that a requirement adds."""
    return {
        "remote driver": ["bus.insecure=true"],  # another host, without certificates
        "third parties": [
            f'safety.limits.lidar={{lease = {LIMIT_LEASE_S}, silence = "stop"}}',
            f'safety.limits.pendant={{lease = {PENDANT_LEASE_S}, silence = "latch"}}',
        ],
        "relay": [
            f"board.address={RELAY_TO_PC}", f"board.listen_address={PC}",
            f"board.relay_port={RELAY_PORT}",
        ],
        "site": [f"bus.uplink=tcp/127.0.0.1:{free_port()}"],
    }.get(need, [])  # fmt: skip


def _beside(need: Requirement, folder: Path, config: Everything) -> dict[str, list[str]]:
    """Return the commands of the driver, and of the processes that a requirement adds."""
    endpoint = operators_endpoint(config)
    driver = [*MODULE, SOURCE, endpoint, DRIVE]
    if need == "remote driver":
        driver = [*MODULE, REMOTE_HOST, endpoint, SOURCE, DRIVE]
    if need == "separate clocks":
        own = [f"{name}={value}" for name, value in clock(folder / CLOCKS[1]).items()]
        driver = ["env", *own, *driver]
    made = {"driver": driver}
    if need == "third parties":
        made |= {name: [*MODULE, SOURCE, endpoint, key] for name, key in THIRD_PARTIES.items()}
    if need == "relay":
        words = ["--board-port", str(config.board.port), "--ports"]
        words += map(str, config.board.listen_ports)
        made["relay"] = ["ip", "netns", "exec", RELAY_HOST, *MODULE, "services.relay", *words]
    if need == "site":
        made["site router"] = [*MODULE, "cli", "router", "--set", f"bus.listen={endpoint}"]
    return made


def _independent_board(config: Everything) -> list[str]:
    ports = (config.board.port, *config.board.listen_ports)
    return [*MODULE, INDEPENDENT_BOARD, *map(str, ports)]


@contextlib.contextmanager
def stack_fixture(
    folder: Path, *, shipped: bool = True, need: Requirement = "none"
) -> Iterator[StackFixture]:
    """Run a stack fixture that meets the requirement of a fault."""
    with contextlib.ExitStack() as stack:
        if need == "small disk":
            stack.enter_context(small_disk(folder / "disk"))
        if need == "relay":
            stack.enter_context(relay_host())
        made = stack.enter_context(
            running_stack(
                folder,
                shipped=shipped,
                sets=[*QUICK, *_settings(need)],
                profiles=[QUICK_MOTORS],
                sim_sets=SIM_BEHIND_RELAY if need == "relay" else (),
                beside=partial(_beside, need, folder),
                board=_independent_board if need == "independent board" else None,
                log="disk/log.jsonl" if need == "small disk" else "log.jsonl",
                listen=f"tcp/{'0.0.0.0' if need == 'remote driver' else '127.0.0.1'}:{{port}}",
                env=os.environ | clock(folder / CLOCKS[0]) if need == "separate clocks" else None,
            )
        )
        bus = stack.enter_context(session(operators_endpoint(made.config)))
        yield StackFixture(made, Client(bus))
