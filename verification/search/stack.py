"""The real shells of bridge, safety and odometry, a vehicle and sources, in simulated time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from common.operator import release_request, reset_request
from common.wire.commands import MotionCommand, MotionKind
from common.wire.framing import Framing, Received
from common.wire.reports import FROM_BOARD
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from services.safety.config import LimitSource, Safety, SafetyConfig
from services.safety.service import SafetyService
from sim.config import Config
from sim.world import Plan
from verification.search.bus import MS, ROBOT, Caller, Net, Process
from verification.search.condition_books import IGNORED, LEASE_S, NEEDED
from verification.search.oracle import STEP_NS, Oracle
from verification.search.sources import PENDANT, Limiter, Pendant, Stick
from verification.search.vehicle import Vehicle

START_NS = 100 * NS_PER_S
ASK_NS = 50 * MS
BREAK_NS = 50 * MS
PLANE = Plan(title="an empty plane")
THIRD_PARTIES = Safety(
    limits={
        NEEDED: LimitSource(lease=LEASE_S, silence="stop"),
        IGNORED: LimitSource(lease=LEASE_S, silence="ignore"),
    },
    estop_keepalive=(PENDANT,),
)


class Sockets:
    """The bridge's end of the cable."""

    refused = send_errors = 0
    last_foreign_source = None

    def __init__(self, stack: "Stack", process: Process) -> None:
        self.sockets = [object() for _ in process.config.board.listen_ports]
        self._stack = stack
        self._process = process
        self._framing = Framing()

    def read(self, first: int, *ports: int) -> Iterator[tuple[int, bytes, int]]:
        """Yield what waits at these ports, after the oracle has seen it."""
        for port in sorted(ports, key=lambda port: port != first):
            inbox = self._stack.vehicle.inboxes[port]
            while inbox:
                datagram = inbox.popleft()
                parts = self._framing.read(datagram, FROM_BOARD)
                frames = [part.frame for part in parts if isinstance(part, Received)]
                self._stack.oracle.on_report(self._process, frames, port)
                yield port, datagram, self._stack.net.now_ns

    def take_relay_report(self) -> bytes:
        """Return nothing: there is no relay."""
        return b""

    def send(self, datagram: bytes, port: int, attempts: int = 1) -> bool:
        """Send to the board, with the oracle's complaints."""
        complaints = self._stack.oracle.on_leaving(self._process, datagram)
        self._stack.vehicle.receive(datagram, port, complaints)
        return True


class Stack:
    """The services, a vehicle and sources; ``run`` lets time pass.

    The guard is a model: the real one is tested in ``tests/bridge``.
    """

    def __init__(
        self,
        config: Config | None = None,
        plan: Plan = PLANE,
        *,
        odometry: bool = False,
        step_ns: int = STEP_NS,
    ) -> None:
        config = config or Config()
        self.net = Net(START_NS)
        self.oracle = Oracle(START_NS)
        # Lost and late datagrams may take the STOP that would have been in time.
        for line in (config.sim.cable.to_board, config.sim.cable.to_pc):
            self.oracle.slack_ns += round((line.delay + line.jitter) * 1e9)
            self.oracle.slack_ns += 150 * MS if line.drop or line.corrupt else 0
        self.vehicle = Vehicle(self.net, self.oracle.on_board, config, plan)
        self._step_ns = step_ns
        self._boots = 1000
        self._brake_ns: int | None = None  # when the guard brakes next
        self._starts: dict[str, int] = {}
        self.safety = self._start("safety")
        self.bridge = self._start("bridge")
        self.odometry = [self._start_odometry()] if odometry else []
        self.sticks = {name: Stick(name, self.process(name)) for name in ("teleop", "nav")}
        self.limiters = {name: Limiter(name, self.process(name)) for name in (NEEDED, IGNORED)}
        self.limiters[NEEDED].caps = (None, None)
        self.pendant = Pendant(PENDANT, self.process(PENDANT))
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
                setattr(self, name, self._start(name))
                del self._starts[name]
        self.vehicle.turn()
        self._guard()
        self.net.turn()
        for process in (self.bridge, self.safety, *self.odometry):
            process.turn()
            self.net.turn()
        if self.net.now_ns % ASK_NS == 0:
            for source in (*self.sticks.values(), *self.limiters.values(), self.pendant):
                source.publish()
            self.net.turn()
        self.oracle.on_step(self.vehicle.silent)

    def _guard(self) -> None:
        """Brake while there is no bridge."""
        if self.bridge.alive or (self._brake_ns or 0) > self.net.now_ns:
            return
        self._brake_ns = self.net.now_ns + BREAK_NS
        self.vehicle.receive(Framing().pack(MotionCommand(MotionKind.BREAK)), 0, ())

    # --- processes --------------------------------------------------------------------------

    def process(self, name: str, config: Any = None) -> Process:
        """Return a new process on the bus."""
        self._boots += 1
        return Process(name, self.net, config, self._boots, self.oracle)

    def _start(self, name: str) -> Process:
        config = SafetyConfig(safety=THIRD_PARTIES) if name == "safety" else BridgeConfig()
        process = self.process(name, config)
        self.oracle.on_start(process)
        with self.time():
            if name == "safety":
                SafetyService(process, process)  # type: ignore[arg-type]
            else:
                made = Sockets(self, process)
                with patch("services.bridge.bridge.Sockets", lambda *_, **__: made):
                    Bridge(process)  # type: ignore[arg-type]
        return process

    def _start_odometry(self) -> Process:
        process = self.process("odom", OdomConfig())
        with self.time():
            Odometer(process)  # type: ignore[arg-type]
        return process

    def kill(self, name: str, pause_ms: int) -> None:
        """Kill a process; another one starts after a pause."""
        process: Process = getattr(self, name)
        if not process.alive:
            return
        process.alive = False
        self.oracle.on_end(process)
        self._starts[name] = self.net.now_ns + pause_ms * MS
        self._brake_ns = None
        if name == "bridge":
            for inbox in self.vehicle.inboxes:
                inbox.clear()

    def stall(self, name: str, duration_ms: int) -> None:
        """Stall a process for this time."""
        process: Process = getattr(self, name)
        process.stall(duration_ms)
        if name == "bridge":
            self.oracle.slack_ns = max(self.oracle.slack_ns, duration_ms * MS)

    def power_cycle(self, duration_ms: int) -> None:
        """Restart the board, and wait until it is back."""
        self.vehicle.power_cycle(duration_ms)
        self.oracle.on_power_cycle()
        self.run(duration_ms)
        self.oracle.comeback_ns = self.net.now_ns

    def router(self, up: bool) -> None:
        """Take the router away, or bring it back."""
        self.net.connections += up and not self.net.up
        self.net.up = up
        self.oracle.on_router(up)

    # --- people -----------------------------------------------------------------------------

    def estop(self) -> None:
        """Press the emergency stop."""
        self.hand.post(keys.estop_key(ROBOT), m.Message())

    def _look(self, arrival: Any) -> None:
        self.seen = arrival.message

    def reset(self, seen: m.SafetyState | None = None) -> Caller:
        """Ask for a reset of what is latched, as it is seen now or as it was seen earlier."""
        seen = seen or self.seen
        return self.call_reset(reset_request(seen) if seen else m.ResetRequest())

    def call_reset(self, request: m.ResetRequest) -> Caller:
        """Call safety, and wait until it has decided."""
        with self.time():
            caller = self.safety.call(keys.RESET, request)
        if caller.done:
            self.oracle.on_reset(self.safety, request)
        self.run(5)
        return caller

    def hold(
        self, held: bool, direction: m.Direction = "backward", seen: m.SafetyState | None = None
    ) -> Caller:
        """Hold the release, or let it go, by what is seen now or was seen earlier."""
        return self.call_release(release_request(seen or self.seen, direction, held=held))

    def call_release(self, request: m.ReleaseRequest) -> Caller:
        """Call safety, and wait until it has decided."""
        before = self.oracle.holds(self.safety)
        self.oracle.on_hold(self.safety, request)  # a verdict comes along with the answer
        with self.time():
            caller = self.safety.call(keys.RELEASE, request)
        if not caller.done:
            self.oracle.on_refusal(self.safety, before)
        self.run(5)
        return caller

    def switches(self, *, on: bool) -> bool:
        """Ask the bridge to set the board's bumper brake."""
        echo = self.seen.heartbeat if self.seen else None
        request = m.SwitchesRequest(bumper_brake=on, echo=echo)
        with self.time():
            return self.bridge.call(keys.SET_SWITCHES, request).done is not False
