"""The whole chain in one thread and in simulated time: every core, no bus, no socket, no process.

It shows what the shipped settings do on a machine that is never late, faster than real time and
the same each time. The shells are tested elsewhere, with real processes.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from cli.lap.script import Ask as Wish
from cli.lap.script import Lap, View
from common import messages as m
from common.freshness import Latest, S
from common.wire.framing import Framing, Received
from common.wire.reports import (
    FROM_BOARD,
    BumperBrakeReport,
    BumperReport,
    DistanceReport,
    DriverReport,
    UltrasonicBrakeReport,
    UltrasonicReport,
    VelocityReport,
)
from services.bridge import lease as leases
from services.bridge import switches as brakes
from services.bridge.bridge import queries
from services.bridge.config import BridgeConfig
from services.bridge.lease import Lease, Order
from services.bridge.poll import Poll
from services.bridge.translate import BumperFilter, Translator, driver
from services.odom.config import Odom
from services.odom.estimator import Estimator
from services.safety.config import SafetyConfig
from services.safety.inputs import Ask, Event, Hold, Inputs, Reset
from services.safety.policy import Policy
from services.safety.report import motion_message, state_message
from sim import trace as t
from sim.config import Config
from sim.files import load_plan
from sim.simulation import Simulation

MS = S // 1000
TICK_NS = 10 * MS
BOOT = 77  # of the bridge
START_NS = 100 * S


class Clockwork:
    """Sim, bridge, safety, odometry and the lap's driver, turned by hand."""

    def __init__(self, lap: Lap, world: str = "office") -> None:
        self.lap = lap
        self.now_ns = START_NS
        self.records: list[t.Line] = []
        self.odometry: list[m.Odometry] = []
        self.answers: list[tuple[str, bool, str]] = []
        bridge, safety = BridgeConfig(), SafetyConfig()
        self.sim = Simulation(Config(), load_plan(world, safety.vehicle), START_NS)
        self._port = bridge.board.listen_ports[0]
        self._framing = Framing()
        self._translator = Translator(bridge.wire, bridge.vehicle, 1.0, 1.0)
        self._lease_ns, self._coast_ns = round(bridge.bridge.lease * S), S
        self._lease = Lease(over_since_ns=START_NS)
        self._switches = brakes.on_return(START_NS)
        self._poll = Poll(queries(bridge.bridge), bridge.bridge.answer_timeout)
        self._bumper = BumperFilter()
        self._seq: Counter[str] = Counter()
        self._policy = Policy(safety.safety, safety.vehicle)
        self._state = self._policy.start()
        self._inputs = Inputs(reader=True)
        self._estimator = Estimator(Odom())
        self._velocity = m.Velocity(linear=0.0, angular=0.0)
        self._told: m.SafetyState | None = None
        self._refusal: str | None = None
        self._granted = False
        self._index = 0

    def run(self, seconds: float) -> Iterator[None]:
        """Turn for so long, a tick at a time."""
        end_ns = self.now_ns + round(seconds * S)
        while self.now_ns < end_ns:
            self.now_ns += TICK_NS
            self.sim.advance(self.now_ns)
            self._deliver()
            self._tick()
            yield

    # --- bridge ---------------------------------------------------------------------------

    def _deliver(self) -> None:
        for datagram in self.sim.take_sent(self.now_ns):
            if datagram.port == self._port:
                for part in self._framing.read(datagram.payload, FROM_BOARD):
                    assert isinstance(part, Received), part
                    self._hear(part.frame)
        self.records += self.sim.take_records()

    def _hear(self, frame: object) -> None:
        match frame:
            case VelocityReport():
                self._velocity = self._translator.velocity(frame)
                self._estimator.on_velocity(self._velocity, self.now_ns)
                self._keep(velocity=self._velocity)
            case DistanceReport():
                self._poll.answered("mileage", self.now_ns)
                self._estimator.on_mileage(self._translator.mileage(frame, 0), self.now_ns)
            case UltrasonicReport():
                self._poll.answered("ultrasonic", self.now_ns)
                self._keep(ultrasonic=self._translator.ultrasonic(frame))
                self._decide()
            case BumperReport():
                self._hear_bumper(frame)
            case DriverReport():
                self._poll.answered(f"driver_{frame.side.name.lower()}", self.now_ns)
                self._keep(**{frame.side.name.lower(): driver(frame)})
            case UltrasonicBrakeReport():
                self._switches = brakes.on_echo(self._switches, frame.on, None)
            case BumperBrakeReport():
                self._switches = brakes.on_echo(self._switches, None, frame.on)
            case _:
                raise AssertionError(frame)

    def _hear_bumper(self, frame: BumperReport) -> None:
        self._poll.answered("bumper", self.now_ns)
        message, hit = self._bumper.take(frame.on)
        if hit:
            self._lease, order = leases.on_hit(self._lease, self._seq["bumper"] + 1, self.now_ns)
            self._order(order)
        if message is not None:
            self._keep(bumper=message)
            self._decide()

    def _order(self, order: Order, motion: m.Motion | None = None) -> None:
        self._send(self._translator.command(order, motion))

    def _send(self, frame: Any) -> None:
        self.sim.receive(self._framing.pack(frame), self._port, self.now_ns)

    # --- safety ---------------------------------------------------------------------------

    def _keep(self, **samples: m.Message) -> None:
        latest = {}
        for name, sample in samples.items():
            self._seq[name] += 1
            stamped = replace(sample, seq=self._seq[name], boot=BOOT)
            latest[name] = Latest(stamped, self.now_ns)
        self._inputs = replace(self._inputs, **latest)

    def _decide(self, event: Event | None = None) -> None:
        inputs = replace(self._inputs, event=event)
        self._state, verdict = self._policy.decide(self._state, inputs, self.now_ns)
        if verdict.reply:
            self._refusal = None if verdict.reply.done else verdict.reply.text
            self._granted = verdict.reply.done
            self.answers.append((type(event).__name__, verdict.reply.done, verdict.reply.text))
        self._seq["motion"] += 1
        motion = replace(motion_message(self._state, inputs), seq=self._seq["motion"], boot=1)
        self._lease, order, _ = leases.on_motion(
            self._lease, motion, self.now_ns, self._lease_ns, BOOT
        )
        if order is not None:
            self._order(order, motion)

    # --- by time --------------------------------------------------------------------------

    def _tick(self) -> None:
        elapsed = (self.now_ns - START_NS) // TICK_NS
        self._tick_bridge(elapsed)
        if elapsed % 2 == 0:
            self._decide()
            estimate = self._estimator.estimate(self.now_ns)
            if estimate is not None:
                self.odometry.append(replace(estimate, mono_ns=self.now_ns))
        if elapsed % 5 == 0:
            beat = self._state.heartbeat.beat(self.now_ns)
            self._state = replace(self._state, heartbeat=beat)
            self._told = state_message(self._policy, self._state, self.now_ns)
            self._drive()
        self._deliver()

    def _tick_bridge(self, elapsed: int) -> None:
        self._switches, frames = brakes.on_tick(self._switches, self.now_ns)
        self._lease = leases.on_ready(self._lease, self._switches.verified)
        standing = leases.standing(self._velocity.linear, self._velocity.angular)
        self._lease, order = leases.on_tick(
            self._lease, self.now_ns, self._lease_ns, self._coast_ns, standing
        )
        if order is not None:
            self._order(order)
        for frame in (*frames, *self._poll.due(self.now_ns)):
            self._send(frame)
        if elapsed % 20 == 0:
            on = self._switches
            self._keep(
                switches=m.Switches(ultrasonic_brake=on.ultrasonic, bumper_brake=on.bumper),
                link=m.Link(
                    state="up", board="", epoch=0, rates={}, rejected={}, round_trip=None,
                    armed=not self._lease.waiting, waiting=self._lease.waiting,
                ),
            )  # fmt: skip

    def _drive(self) -> None:
        assert self._told is not None
        if not self.odometry:
            return
        pressed = bool(self._bumper.pressed)
        view = View(self.odometry[-1], self._told, pressed, self._refusal, self._granted)
        wish = self.lap.advance(view, self.now_ns)
        if self.lap.index != self._index:
            self._index, self._refusal, self._granted = self.lap.index, None, False
        self._wish(wish, self._told.heartbeat)

    def _wish(self, wish: Wish, echo: int) -> None:
        self._seq["drive"] += 1
        linear, angular = wish.twist
        request = m.Drive(linear=linear, angular=angular, echo=echo, seq=self._seq["drive"], boot=5)
        self._decide(Ask("demo", request))
        if wish.press == "reset":
            self._decide(Reset())
        elif wish.press == "release":
            self._decide(Hold(True))
