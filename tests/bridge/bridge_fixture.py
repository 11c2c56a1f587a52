"""A real bridge between a test board and a test bus: what the tests of the process share."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.bus.drive import DriveLink
from common.bus.publisher import Publisher
from common.loop import Loop
from common.motion import Command
from common.wire.commands import MotionKind
from tests.factories import safety_state
from verification.harness.fake_board import Board
from verification.harness.waiting import wait_until

PROC = Path("/proc")


@dataclass
class BridgeFixture:
    """A bridge between a test board and a test bus on which the test plays safety."""

    board: Board
    endpoint: str
    loop: Loop
    process: "subprocess.Popen[bytes]"
    bus: Bus = field(init=False)
    motion: Publisher[m.Motion] = field(init=False)
    safety: Publisher[m.SafetyState] = field(init=False)
    seen: dict[str, list[Any]] = field(default_factory=dict)
    raw: dict[str, bytes] = field(default_factory=dict)
    driving: m.Motion | None = None
    heartbeat: int = 1000
    rearms: bool = True  # send STOP until the bridge is armed, and latch for it, as safety does

    def declare(self, bus: Bus) -> None:
        self.bus = bus
        self.motion = DriveLink(bus, listens=False).publisher(keys.MOTION)
        self.safety = bus.publisher(keys.SAFETY)
        for topic in (keys.LINK, keys.BUMPER, keys.MILEAGE, keys.ULTRASONIC, keys.VELOCITY):
            bus.subscribe(topic, self._take, depth=64)
        bus.subscribe(keys.SWITCHES, self._take, depth=64)
        bus.subscribe(keys.DRIVER, self._take, depth=64, side="*")
        bus.subscribe(keys.EVENTS, self._take, depth=64, service="bridge")
        self.loop.post(lambda: self.loop.every(0.05, self._beat))

    def _take(self, arrival: Arrival[Any]) -> None:
        name = arrival.key.removeprefix("t2/v1/001/")
        self.seen.setdefault(name, []).append(arrival.message)
        if arrival.raw:
            self.raw[name] = arrival.raw

    def _beat(self, _: int) -> None:
        self.heartbeat += 1
        self.safety.put(safety_state(heartbeat=self.heartbeat))
        if self.driving is not None:
            bumpers = self.seen.get("tel/bridge/bumper", [m.Bumper(pressed=False)])
            judged = {"judged": bumpers[-1].seq, "judged_boot": bumpers[-1].boot}
            link = self.link()
            waits = self.rearms and link is not None and not link.armed
            fields = {"command": Command.STOP} if waits else _fields(self.driving)
            if waits and link is not None and link.latched_by == link.boot:
                fields = {"command": Command.BRAKE, "latched": True, "predecessor": link.boot}
            self.motion.put(m.Motion(**{**fields, **judged}))

    def command(self, command: Command, linear: float = 0.0) -> None:
        """Publish this command at 20 Hz, as safety does."""
        self.driving = m.Motion(command=command, linear=linear, source="test")

    def silence(self) -> None:
        """Stop publishing commands."""
        self.driving = None

    def newest(self, name: str) -> Any:
        return self.seen.get(name, [None])[-1]

    def link(self) -> m.Link | None:
        newest: m.Link | None = self.newest("tel/bridge/link")
        return newest

    def events(self) -> list[str]:
        return [event.name for event in self.seen.get("evt/bridge", [])]

    def drive(self) -> None:
        """Bring it to half a metre a second."""
        self.command(Command.STOP)
        wait_until(lambda: (link := self.link()) and link.armed, "an armed bridge")
        self.command(Command.RUN, 0.5)
        self.board.wait_for(MotionKind.RUN, 500)


def _fields(message: m.Motion) -> dict[str, Any]:
    return {name: getattr(message, name) for name in ("command", "linear", "angular", "source")}


def bridge_command(made: Board, endpoint: str, *sets: str) -> list[str]:
    """Return what starts a bridge for this board."""
    settings = [
        f"board.port={made.address[1]}",
        f"board.listen_ports={made.ports}",
        f"bus.connect={endpoint}",
        # Long limits: on test machines, processes stall for tenths of a second.
        "bridge.unsafe_overrides=stall",
        "bridge.stall=0.2",
        *sets,
    ]
    words = [word for setting in settings for word in ("--set", setting)]
    return [sys.executable, "-m", "services.bridge", *words]


@contextmanager
def bridge_process(made: Board, endpoint: str, *sets: str) -> Iterator["subprocess.Popen[bytes]"]:
    """Run a bridge, and its guard, while the context lasts."""
    command = bridge_command(made, endpoint, *sets)
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.wait(20)


def bridge_pid(guard: "subprocess.Popen[bytes]") -> int:
    """Return the process that the guard watches, once there is one."""
    children = PROC / f"{guard.pid}/task/{guard.pid}/children"
    return int(wait_until(lambda: children.read_text().split(), "a bridge under the guard")[0])


def breaks_since(made: Board, count: int) -> int:
    """Return how many BRAKEs the board got after that many commands."""
    return [motion.kind for motion in made.motions[count:]].count(MotionKind.BREAK)
