"""The real shells of bridge, safety and odometry, a vehicle and sources, in simulated time."""

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.settings import Board
from common.wire import framing
from common.wire.commands import MotionCommand, MotionKind
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from services.ros2.command import SOURCE
from services.safety.config import LimitSource, Safety, SafetyConfig
from services.safety.service import SafetyService
from sim import requests as q
from sim import trace as t
from sim.model import Model
from sim.requests import Asked
from sim.simulation import Simulation
from sim.world import Plan
from t2 import keys
from t2 import messages as m
from verification.search.bus import MS, ROBOT, Caller, Net, Process, Source
from verification.search.condition_books import (
    BRAKING_RADPS2,
    IGNORED,
    LEASE_S,
    NEEDED,
    PENDANT,
    TIMEOUT_S,
)
from verification.search.oracle import STEP_NS, Oracle
from verification.search.ros import RosSource
from verification.search.safety_book import FRONT

START_NS = 100 * NS_PER_S
ASK_NS = 50 * MS
BREAK_NS = 50 * MS
IDEAL = Model()
PLANE = Plan(title="an empty plane")
CONFIGS = {
    "bridge": BridgeConfig(),
    "safety": SafetyConfig(
        safety=Safety(
            limits={
                NEEDED: LimitSource(lease=LEASE_S, silence="stop"),
                IGNORED: LimitSource(lease=LEASE_S, silence="ignore"),
                PENDANT: LimitSource(lease=TIMEOUT_S, silence="latch"),
            },
        )
    ),
    "odom": OdomConfig(),
}  # in the order of their turns


class Vehicle:
    """The simulated vehicle at the other end of the cable."""

    def __init__(self, net: Net, model: Model, plan: Plan, seed: int) -> None:
        self.ports = Board().listen_ports
        self.simulation = Simulation(model, plan, net.now_ns, seed, self.ports)
        self.inboxes: tuple[deque[bytes], ...] = tuple(deque() for _ in self.ports)  # the bridge's
        self.truth = self.simulation.truth(net.now_ns)  # the newest, 20 times a second
        self.records: list[t.Line] = []
        self._net = net

    def inject(self, request: Asked) -> None:
        """Inject a fault of the simulator."""
        self.simulation.handle(request, self._net.now_ns)

    def receive(self, datagram: bytes, port: int) -> None:
        """Send a datagram to the board, from a port of the bridge."""
        self.simulation.receive(datagram, self.ports[port], self._net.now_ns)

    def turn(self) -> None:
        """Advance to the current time."""
        self.simulation.advance(self._net.now_ns)
        for datagram in self.simulation.take_sent(self._net.now_ns):
            self.inboxes[self.ports.index(datagram.port)].append(datagram.payload)

    def take_records(self) -> list[t.Line]:
        """Return what has happened since the last call."""
        records = list(self.simulation.take_records())
        self.records += records
        self.truth = next((one for one in records[::-1] if isinstance(one, t.Truth)), self.truth)
        return records


class Sockets:
    """The bridge's end of the cable."""

    refused = send_errors = 0
    last_foreign_source = None

    def __init__(self, stack: "Stack", process: Process) -> None:
        self.sockets = [object() for _ in stack.vehicle.ports]
        self._stack = stack
        self._process = process

    def read(self, first: int, *ports: int) -> Iterator[tuple[int, bytes, int]]:
        """Yield what waits at these ports, after the oracle has seen it."""
        for port in sorted(ports, key=lambda port: port != first):
            inbox = self._stack.vehicle.inboxes[port]
            while inbox:
                datagram = inbox.popleft()
                self._stack.oracle.on_report(self._process, datagram, port)
                yield port, datagram, self._stack.net.now_ns

    def take_relay_report(self) -> bytes:
        """Return nothing: there is no relay."""
        return b""

    def send(self, datagram: bytes, port: int, attempts: int = 1) -> bool:
        """Send to the board, after the oracle has seen it."""
        self._stack.oracle.on_leaving(self._process, datagram)
        self._stack.vehicle.receive(datagram, port)
        return True


class Stack:
    """The services, a vehicle and sources; ``run`` lets time pass.

    The guard is a model: the real one is tested in ``tests/bridge``.
    """

    def __init__(
        self,
        model: Model = IDEAL,
        plan: Plan = PLANE,
        *,
        seed: int = 1,
        step_ns: int = STEP_NS,
        turn_braking: float = BRAKING_RADPS2,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        """Set up; ``turn_braking`` is the angular deceleration of the settings (rad/s^2).

        ``settings`` are further ones, by their paths. The oracle does not know them.
        """
        self.net = Net(START_NS)
        self.oracle = Oracle(START_NS, turn_braking=turn_braking)
        if front := model.vehicle.sonars.get("front"):
            self.oracle.recess = FRONT - front.x
        # Lost and late datagrams may take the STOP that would have been in time.
        for line in (model.cable.to_board, model.cable.to_pc):
            late_ns = round((line.delay + line.jitter) * 1e9)
            self.oracle.slack_ns += late_ns
            self.oracle.press.slack_ns += late_ns
            self.oracle.slack_ns += 150 * MS if line.drop or line.corrupt else 0
        self.vehicle = Vehicle(self.net, model, plan, seed)
        self._step_ns = step_ns
        self._body = model.vehicle
        self._settings = settings or {}
        self._boots = 1000
        self._brake_ns = 0  # when the guard brakes next
        self._free_ns: int | None = None  # when a tap of the bumper ends
        self._starts: dict[str, int] = {}
        self.processes = {name: self._start(name) for name in CONFIGS}
        self.sources = {
            "teleop": Source("teleop", keys.DRIVE, self.process("teleop")),
            "nav": Source("nav", keys.DRIVE, self.process("nav")),
            SOURCE: RosSource(self.process(SOURCE), self.oracle.violations),
            NEEDED: Source(NEEDED, keys.LIMIT, self.process(NEEDED), m.Limit(echo=0)),
            IGNORED: Source(IGNORED, keys.LIMIT, self.process(IGNORED)),
            PENDANT: Source(PENDANT, keys.LIMIT, self.process(PENDANT), m.Limit(echo=0)),
        }
        self.hand = self.process("hand")  # sees what operators see, and sends what has no source
        self.seen: m.SafetyState | None = None
        self.hand.subscribe(keys.SAFETY, self._look)

    def run(self, duration_ms: int) -> None:
        """Advance the time."""
        end_ns = self.net.now_ns + duration_ms * MS
        with self.time():
            while self.net.now_ns < end_ns:
                self.net.now_ns += self._step_ns
                self.oracle.now_ns = self.net.now_ns
                self._turn()

    @contextmanager
    def time(self) -> Iterator[None]:
        """Replace the services' clock by the simulated time; contexts may be nested."""
        with patch("common.clock.now_ns", lambda: self.net.now_ns):
            yield

    def _turn(self) -> None:
        for name, due_ns in list(self._starts.items()):
            if due_ns <= self.net.now_ns:
                self.processes[name] = self._start(name)
                del self._starts[name]
        if self._free_ns is not None and self._free_ns < self.net.now_ns:
            self._free_ns = None
            self.vehicle.inject(q.Bumper(pressed=False))
        self.vehicle.turn()
        self.oracle.on_contact(self.vehicle.simulation.board.pressed)
        self._guard()
        self.net.turn()
        for process in self.processes.values():
            process.turn()
            self.net.turn()
        if self.net.now_ns % ASK_NS == 0:
            for source in self.sources.values():
                source.publish()
            self.net.turn()
        self.oracle.on_step(self.vehicle.take_records())

    def _guard(self) -> None:
        """Brake while there is no bridge."""
        if not self.processes["bridge"].alive and self._brake_ns <= self.net.now_ns:
            self._brake_ns = self.net.now_ns + BREAK_NS
            self.vehicle.receive(framing.pack(MotionCommand(MotionKind.BREAK)), 0)

    # --- processes --------------------------------------------------------------------------

    def process(self, name: str) -> Process:
        """Return a new process on the bus."""
        self._boots += 1
        config = CONFIGS.get(name)
        body = replace(self._body, angular_deceleration=self.oracle.turn_braking)
        if isinstance(config, SafetyConfig | BridgeConfig):
            config = replaced(replace(config, vehicle=body), self._settings)
        return Process(name, self.net, config, self._boots, self.oracle)

    def _start(self, name: str) -> Process:
        process: Any = self.process(name)
        self.oracle.on_start(process)
        with self.time():
            if name == "safety":
                SafetyService(process, process)
            elif name == "odom":
                Odometer(process)
            else:
                made = Sockets(self, process)
                with patch("services.bridge.bridge.Sockets", lambda *_, **__: made):
                    Bridge(process)
        return process  # type: ignore[no-any-return]

    def kill(self, name: str, pause_ms: int) -> None:
        """Kill a process; another one starts after a pause."""
        process = self.processes[name]
        if not process.alive:
            return
        process.alive = False
        self.oracle.on_end(process)
        self._starts[name] = self.net.now_ns + pause_ms * MS
        self._brake_ns = 0
        if name == "bridge":
            for inbox in self.vehicle.inboxes:
                inbox.clear()

    def stall(self, name: str, duration_ms: int) -> None:
        """Stall a process for this time."""
        self.processes[name].stall(duration_ms)
        if name == "bridge":
            self.oracle.slack_ns = max(self.oracle.slack_ns, duration_ms * MS)
            press = self.oracle.press
            press.slack_ns = max(press.slack_ns, duration_ms * MS)

    def router(self, up: bool) -> None:
        """Take the router away, or bring it back."""
        self.net.connections += up and not self.net.up
        self.net.up = up
        self.oracle.on_router(up)

    # --- people -----------------------------------------------------------------------------

    def estop(self) -> None:
        """Press the emergency stop."""
        self.hand.post(keys.estop_key(ROBOT), m.Message())

    def tap(self, duration_ms: int) -> None:
        """Press the bumper for this time."""
        self.vehicle.inject(q.Bumper(pressed=True))
        self._free_ns = self.net.now_ns + duration_ms * MS

    def _look(self, arrival: Any) -> None:
        self.seen = arrival.message

    def reset(self, seen: m.SafetyState | None = None) -> Caller:
        """Ask for a reset of what is latched, as it is seen now or as it was seen earlier."""
        seen = seen or self.seen
        request = m.ResetRequest()
        if seen is not None:
            latched = tuple(cause.id for cause in seen.causes if cause.name in seen.latched)
            request = m.ResetRequest(echo=seen.heartbeat, causes=latched)
        return self.call_reset(request)

    def call_reset(self, request: m.ResetRequest) -> Caller:
        """Call safety, and wait until it has decided."""
        safety = self.processes["safety"]
        with self.time():
            caller = safety.call(keys.RESET, request)
        self.oracle.on_answer(safety, request, bool(caller.done))
        self.run(5)
        return caller


def replaced(config: Any, settings: Mapping[str, Any]) -> Any:
    """Return a configuration with these settings, by path, of the sections that it has."""
    sections: dict[str, Any] = {}
    for path, value in settings.items():
        section, _, name = path.partition(".")
        if (before := sections.get(section, getattr(config, section, None))) is not None:
            sections[section] = replace(before, **{name: value})
    return replace(config, **sections)
