"""The real shells of bridge and safety, a vehicle and operators, in simulated time."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar
from unittest.mock import patch

import msgspec

from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from common.operator import release_request, reset_request
from common.wire.commands import MotionCommand, MotionKind
from common.wire.framing import Framing
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.safety.config import LimitSource, Safety, SafetyConfig
from services.safety.service import SafetyService
from verification.invariants.keepalive import PENDANT, Pendant
from verification.invariants.limits import IGNORED, LEASE_S, NEEDED, Limiter
from verification.invariants.net import MS, Envelope, Net
from verification.invariants.oracle import STEP_NS, Oracle
from verification.invariants.process import ROBOT, Process
from verification.invariants.stand_ins import Sockets
from verification.invariants.vehicle import Complaints, OnMotion, Vehicle

START_NS = 100 * NS_PER_S
ASK_NS = 50 * MS
BREAK_NS = 50 * MS


LIMITS = {
    NEEDED: LimitSource(lease=LEASE_S, silence="stop"),
    IGNORED: LimitSource(lease=LEASE_S, silence="ignore"),
}

THIRD_PARTIES = Safety(limits=LIMITS, estop_keepalive=(PENDANT,))


class Stick:
    """A source that publishes drive requests while ``requested`` is set."""

    def __init__(self, name: str, process: Process) -> None:
        self.name = name
        self.process = process
        self.requested: tuple[float, float] | None = None
        self.echo = 0
        self.seq = 0
        process.subscribe(keys.SAFETY, self._listen)

    def _listen(self, arrival: Any) -> None:
        self.echo = arrival.message.heartbeat

    def request(self) -> None:
        """Publish one request if one is set."""
        if self.requested is not None:
            self.seq += 1
            linear, angular = self.requested
            self.put(m.Drive(linear=linear, angular=angular, echo=self.echo, seq=self.seq))

    def put(self, drive: m.Drive, source: str = "") -> None:
        """Put any request."""
        process = self.process
        drive = msgspec.structs.replace(drive, boot=drive.boot or process.boot)
        key = keys.DRIVE.on(ROBOT, source=source or self.name)
        process.send(Envelope(key, drive, process.boot, process.net.now_ns))


class Board(Protocol):
    """What the stack needs of a simulated vehicle."""

    inboxes: tuple[deque[bytes], ...]  # the bridge's, by port

    @property
    def silent(self) -> bool:
        """Whether the board is frozen."""

    def receive(self, datagram: bytes, port: int, complaints: Complaints) -> None:
        """Send a datagram to the board."""

    def turn(self) -> None:
        """Advance to the current time."""

    def power_cycle(self, duration_ms: int) -> None:
        """Restart the board."""


V = TypeVar("V", bound=Board)


class Chain(Generic[V]):
    """Bridge, safety, a vehicle and operators, turned by hand; ``run`` lets time pass."""

    def __init__(self, make_vehicle: Callable[[Net, OnMotion], V], step_ns: int = STEP_NS) -> None:
        self.net = Net(START_NS)
        self.oracle = Oracle(START_NS)
        self.vehicle = make_vehicle(self.net, self.oracle.on_board)
        self._step_ns = step_ns
        self._boots = 1000
        self._brake_ns: int | None = None  # when the guard brakes next
        self._starts: dict[str, int] = {}
        self.safety = self._start("safety")
        self.bridge = self._start("bridge")
        self.sticks = {
            name: Stick(name, self._process("stick", None)) for name in ("teleop", "nav")
        }
        self.limiters = {
            name: Limiter(name, self._process("limiter", None)) for name in (NEEDED, IGNORED)
        }
        self.limiters[NEEDED].caps = (None, None)
        self.pendant = Pendant(self._process("pendant", None))
        self.hand = self._process("hand", None)
        self.seen: m.SafetyState | None = None  # the newest state that operators see
        self.hand.subscribe(keys.SAFETY, self._look)

    def run(self, duration_ms: int) -> None:
        """Advance the time."""
        end_ns = self.net.now_ns + duration_ms * MS
        while self.net.now_ns < end_ns:
            self.net.now_ns += self._step_ns
            self.oracle.now_ns = self.net.now_ns
            with self.time():
                self._turn()

    def _turn(self) -> None:
        for name, due_ns in list(self._starts.items()):
            if due_ns <= self.net.now_ns:
                setattr(self, name, self._start(name))
                del self._starts[name]
        self.vehicle.turn()
        self._guard()
        self.net.turn()
        for process in self.processes():
            process.turn()
            self.net.turn()
        if self.net.now_ns % ASK_NS == 0:
            for stick in self.sticks.values():
                stick.request()
            for limiter in self.limiters.values():
                limiter.publish()
            self.pendant.publish()
            self.net.turn()
        self.oracle.on_step(self.vehicle.silent)

    def _guard(self) -> None:
        """Brake while there is no bridge: a model, the real one is tested in ``tests/bridge``."""
        if self.bridge.alive or (self._brake_ns or 0) > self.net.now_ns:
            return
        self._brake_ns = self.net.now_ns + BREAK_NS
        self.vehicle.receive(Framing().pack(MotionCommand(MotionKind.BREAK)), 0, ())

    # --- processes --------------------------------------------------------------------------

    def processes(self) -> Iterable[Process]:
        """Return the services, in the order of their turns."""
        return self.bridge, self.safety

    def _process(self, name: str, config: Any) -> Process:
        self._boots += 1
        return Process(name, self.net, config, self._boots, self.oracle)

    def _start(self, name: str) -> Process:
        config = SafetyConfig(safety=THIRD_PARTIES) if name == "safety" else BridgeConfig()
        process = self._process(name, config)
        self.oracle.on_start(process)
        with self.time():
            if name == "safety":
                SafetyService(process, process)  # type: ignore[arg-type]
            else:
                made = Sockets(self, process)
                with patch("services.bridge.bridge.Sockets", lambda *_, **__: made):
                    Bridge(process)  # type: ignore[arg-type]
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
        getattr(self, name).stall(duration_ms)

    def power_cycle(self, duration_ms: int) -> None:
        """Restart the board."""
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
        self.hand.send(
            Envelope(keys.estop_key(ROBOT), m.Message(), self.hand.boot, self.net.now_ns)
        )
        self.run(5)

    def _look(self, arrival: Any) -> None:
        self.seen = arrival.message

    def reset(self, seen: m.SafetyState | None = None) -> bool:
        """Ask for a reset of what is latched, as it is seen now or as it was seen earlier."""
        seen = seen or self.seen
        request = reset_request(seen) if seen else m.ResetRequest()
        with self.time():
            caller = self.safety.call(keys.RESET, request)
        if caller.done:
            self.oracle.on_reset(self.safety, request)
        self.run(5)
        return caller.done is True

    def hold(
        self,
        held: bool,
        direction: m.Direction = "backward",
        seen: m.SafetyState | None = None,
    ) -> bool:
        """Hold the release, or let it go, by what is seen now or was seen earlier."""
        request = release_request(seen or self.seen, direction, held=held)
        before = self.oracle.holds(self.safety)
        self.oracle.on_hold(self.safety, request)  # a verdict comes along with the answer
        with self.time():
            caller = self.safety.call(keys.RELEASE, request)
        if caller.done is not True:
            self.oracle.on_refusal(self.safety, before)
        self.run(5)
        return caller.done is True

    def switches(self, *, on: bool) -> bool:
        """Ask the bridge to set the board's bumper brake."""
        echo = self.seen.heartbeat if self.seen else None
        with self.time():
            caller = self.bridge.call(
                keys.SET_SWITCHES, m.SwitchesRequest(bumper_brake=on, echo=echo)
            )
        return caller.done is not False

    @contextmanager
    def time(self) -> Iterator[None]:
        """Replace the services' clock by the simulated time; contexts may be nested."""
        with patch("common.clock.now_ns", lambda: self.net.now_ns):
            yield


class Stack(Chain[Vehicle]):
    """The chain with a vehicle whose sensors are set by the test."""

    def __init__(self) -> None:
        super().__init__(Vehicle)
