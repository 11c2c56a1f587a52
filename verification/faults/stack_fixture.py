"""A stack of its own to try faults on: the chain, a driver at the stick, an operator."""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Self

import msgspec

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Done, SafetyState
from common.operator import reset_request
from sim.requests import Bumper, Driver, Firmware, Lose, Mute, Place, Wire
from verification.faults.frames import SPEED, Frames, moves
from verification.faults.namespaces import Need, clock, small_disk
from verification.harness.stack import Chain, chain
from verification.harness.support import bus_on, running

# Only to be at speed sooner: no limit of time is touched.
QUICK = [
    "safety.unsafe_overrides=linear_acceleration",
    "safety.linear_acceleration=5",
    "sim.drive.acceleration=10",
]
OPEN = ["bus.insecure=true"]  # for a driver on another host, without certificates
ROOM_M = 900.0  # the vehicle is put back to the origin from there
READY_S = 30.0
DRIVER = "verification.faults.driver"


class Lane:
    """One stack, and hands that drive it."""

    def __init__(
        self, stack: Chain, bus: Bus, folder: Path, driver: Sequence[str], env: Mapping[str, str]
    ) -> None:
        self.stack = stack
        self._driver, self._env = [sys.executable, "-m", *driver], env
        self.bus = bus
        self.folder = folder
        self.frames = Frames(stack.trace_file)
        self.state: SafetyState | None = None
        self.asked = 0.0
        self.death_s = 0.0  # that the kernel took to end what was killed last
        self.start_driver()

    def start_driver(self) -> None:
        """Put a driver at the stick."""
        if "driver" in self.stack.processes:
            self.stack.processes["driver"].communicate()  # closes its pipe, too
        self.stack.processes["driver"] = subprocess.Popen(
            self._driver, stdin=subprocess.PIPE, env=self._env
        )
        self.ask(self.asked)

    def ask(self, speed: float) -> None:
        """Push the stick."""
        self.asked = speed
        self.tell(b"%f" % speed)

    def cable(self, faults: Wire) -> None:
        """Let this happen to the packets between a far driver and the robot from now on."""
        self.tell(msgspec.json.encode(faults))

    def tell(self, line: bytes) -> None:
        """Say a line to whoever drives."""
        pipe = self.stack.processes["driver"].stdin
        assert pipe is not None
        with contextlib.suppress(OSError):  # the driver may be dead
            pipe.write(line + b"\n")
            pipe.flush()

    def dead(self) -> tuple[str, ...]:
        """Return what has ended."""
        ended = [
            name for name, process in self.stack.processes.items() if process.poll() is not None
        ]
        return tuple(ended)

    def revive(self) -> Self:
        """Start what has ended, as whoever supervises would."""
        for name in self.dead():
            if name == "driver":
                self.start_driver()
            else:
                self.stack.start(name)
        return self

    def moving(self) -> bool:
        """Tell whether the board holds a command to move."""
        self.frames.follow()
        return bool(self.frames.commands) and moves(self.frames.commands[-1])

    def at_speed(self) -> bool:
        """Tell whether the board was told to go as fast as asked."""
        return self.moving() and self.frames.commands[-1].linear > SPEED - 0.01

    def neutral(self) -> bool:
        """Tell whether the board holds a RUN of zero: the neutral was taken."""
        self.frames.follow()
        last = self.frames.commands[-1:]
        return bool(last) and last[0].kind == "run" and not moves(last[0])

    def latched(self) -> bool:
        """Tell whether safety wants a reset."""
        return self.state is not None and bool(self.state.latched)

    def flapping(self) -> bool:
        """Tell whether a reset is due only because the campaign makes faults again and again."""
        return self.state is not None and self.state.latched == ("flapping",)

    def reset(self) -> None:
        """Ask safety for a reset, as the operator does."""
        done: list[Done | str] = []
        if self.state is None:
            return
        self.bus.ask(keys.RESET, reset_request(self.state), done.append, done.append, 1.0)
        until(lambda: done, 1.5)

    def rearm(self, patience_s: float) -> bool:
        """Center the stick and push it again; tell whether the vehicle drives."""
        self.ask(0.0)
        until(self.neutral, patience_s)
        self.ask(SPEED)
        return until(self.at_speed, patience_s)

    def ready(self) -> None:
        """Bring the vehicle to speed, whatever that takes; AssertionError when nothing helps."""
        self.revive().mend()
        if self.at_speed() and not self.latched():
            self.frames.forget()
            return
        end_s = time.monotonic() + READY_S
        while time.monotonic() < end_s:
            self.revive()
            if self.latched():
                self.ask(0.0)
                time.sleep(0.1)
                self.reset()
            if self.rearm(2.0):
                self.frames.forget()
                return
        said = self.stack.log.read_text()[-2000:]
        raise AssertionError(f"does not drive: {self.state}\n{said}")

    def mend(self) -> None:
        """Undo whatever was done to the simulated board, and put the vehicle back in its room."""
        self.stack.control.do(Wire())
        self.stack.control.do(Mute())
        self.stack.control.do(Firmware())
        self.stack.control.do(Lose())
        self.stack.control.do(Bumper(pressed=False))
        for side in ("left", "right"):
            self.stack.control.do(Driver(side=side, bits=0))
        if abs(self.stack.control.truth().x) > ROOM_M:
            self.stack.control.do(Place(x=0.0, y=0.0))


def until(true: Callable[[], object], patience_s: float) -> bool:
    """Return whether it becomes true in time."""
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        if true():
            return True
        time.sleep(0.004)
    return False


@contextlib.contextmanager
def lane(folder: Path, *, shipped: bool = True, need: Need = "nothing") -> Iterator[Lane]:
    """Run a lane while the context lasts, on the machine that some faults need."""
    far, clocks, disk = (need == one for one in ("a far driver", "other clocks", "a small disk"))
    with contextlib.ExitStack() as stack:
        if disk:
            stack.enter_context(small_disk(folder / "disk"))
        made = stack.enter_context(
            chain(
                folder, sets=[*QUICK, *OPEN] if far else QUICK, shipped=shipped,
                log="disk/log.jsonl" if disk else "log.jsonl",
                listen=f"tcp/{'0.0.0.0' if far else '127.0.0.1'}:{{port}}",
                env=clock(folder / "robot") if clocks else None,
            )
        )  # fmt: skip
        driver = {
            "a far driver": ["verification.faults.remote_host", made.endpoint, DRIVER],
            "a teleop": ["verification.faults.keyboard", made.endpoint],
        }.get(need, [DRIVER, made.endpoint])
        env = clock(folder / "driver") if clocks else os.environ
        yield stack.enter_context(driven(made, folder, driver, env))


@contextlib.contextmanager
def driven(
    stack: Chain, folder: Path, driver: Sequence[str], env: Mapping[str, str]
) -> Iterator[Lane]:
    """Put a driver and an operator before a stack while the context lasts."""
    with running(Loop()) as loop:
        it: list[Lane] = []

        def take(arrival: Arrival[SafetyState]) -> None:
            if it:
                it[0].state = arrival.message

        with bus_on(stack.endpoint, loop, lambda bus: bus.subscribe(keys.SAFETY, take)) as bus:
            it.append(Lane(stack, bus, folder, driver, env))
            yield it[0]
