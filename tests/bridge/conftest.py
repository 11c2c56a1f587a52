"""A real bridge between a test board and a test bus; on the shared router."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from common.bus.bus import Arrival, Bus
from common.bus.drive import DriveLink
from common.bus.publisher import Publisher
from common.loop import Loop
from common.wire.commands import MotionKind
from t2 import keys
from t2 import messages as m
from t2.messages import Command
from tests.factories import safety_state
from verification.harness.bus import bus_on, running, set_options
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until


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
    seen: dict[str, list[Arrival[Any]]] = field(default_factory=dict)
    driving: dict[str, Any] | None = None
    heartbeat: int = 1000

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
        self.seen.setdefault(arrival.key.removeprefix("t2/v1/001/"), []).append(arrival)

    def _beat(self, _: int) -> None:
        """Publish a state, and the motion that is commanded: STOP until the bridge is armed."""
        self.heartbeat += 1
        self.safety.put(safety_state(heartbeat=self.heartbeat))
        if self.driving is not None:
            bumper = self.newest("tel/bridge/bumper") or m.Bumper(pressed=False)
            judged: dict[str, Any] = {"judged": bumper.seq, "judged_boot": bumper.boot}
            link = self.newest("tel/bridge/link")
            fields = self.driving if link and link.armed else {"command": Command.STOP}
            self.motion.put(m.Motion(**fields, **judged))

    def newest(self, name: str) -> Any:
        return self.seen[name][-1].message if name in self.seen else None

    def events(self) -> list[str]:
        return [arrival.message.name for arrival in self.seen.get("evt/bridge", [])]

    def beats(self, count: int) -> None:
        """Wait for this number of safety's states."""
        end = self.heartbeat + count
        wait_until(lambda: self.heartbeat >= end, f"{count} states of safety")

    def drive(self) -> None:
        """Bring it to half a metre a second."""
        self.driving = {"command": Command.RUN, "linear": 0.5, "source": "test"}
        self.board.wait_for(MotionKind.RUN, 500)


def bridge_command(made: Board, endpoint: str) -> list[str]:
    """Return what starts a bridge for this board."""
    settings = set_options(
        f"board.port={made.address[1]}",
        f"board.listen_ports={made.ports}",
        f"bus.connect={endpoint}",
        # Long limits: on test machines, processes stall for tenths of a second.
        "unsafe_overrides=host.stall",
        "host.stall=0.2",
    )
    return [sys.executable, "-m", "services.bridge", *settings]


@pytest.fixture
def bridge(shared_router: str) -> Iterator[BridgeFixture]:
    with (
        board() as made,
        subprocess.Popen(bridge_command(made, shared_router)) as process,
        running(Loop()) as loop,
    ):
        bridge = BridgeFixture(made, shared_router, loop, process)
        try:
            with bus_on(shared_router, loop, bridge.declare):
                yield bridge
        finally:
            process.terminate()
            process.wait(20)
