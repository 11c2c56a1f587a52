"""The whole chain in one thread and in simulated time: every core, no bus, no socket, no process.

It shows what the shipped settings do on a machine that is never late, faster than real time and
the same each time. The shells are tested elsewhere, with real processes.
"""

from collections import Counter
from collections.abc import Callable

from msgspec.structs import replace

from common import messages as m
from common.freshness import NS_PER_S, Latest
from services.bridge.config import BridgeConfig
from services.bridge.core import Core
from services.bridge.output import Output, Send
from services.odom.config import Odom
from services.odom.estimator import Estimator
from services.safety.config import SafetyConfig
from services.safety.inputs import Event, Inputs
from services.safety.policy import Policy, brake_for_contact
from services.safety.report import motion_message, state_message
from services.safety.state import Reply
from sim import trace as t
from sim.config import Config, load_plan
from sim.simulation import Simulation

MS = NS_PER_S // 1000
TICK_NS = 10 * MS
BOOT = 77  # of the bridge
START_NS = 100 * NS_PER_S


class SimulatedStack:
    """Sim, bridge, safety and odometry, turned by hand.

    ``on_message`` is called with each message that a client may read, and its name; the calls of
    ``each_beat`` are made 20 times a second.
    """

    def __init__(self, world: str = "office") -> None:
        self.on_message: Callable[[str, m.Message], object] = lambda *_: None
        self.each_beat: list[Callable[[], object]] = []
        self.now_ns = START_NS
        self.records: list[t.Line] = []
        self.odometry: list[m.Odometry] = []
        self.answers: list[tuple[str, bool, str]] = []
        bridge, safety = BridgeConfig(), SafetyConfig()
        self.sim = Simulation(Config(), load_plan(world, safety.vehicle), START_NS)
        self._ports = bridge.board.listen_ports
        self._bridge = Core(bridge, BOOT, Counter(), START_NS)
        self._seq: Counter[str] = Counter()
        self._policy = Policy(safety.safety, safety.vehicle)
        self._state = self._policy.start()
        self._inputs = Inputs(estop_connection=1, boot=1)
        self._estimator = Estimator(Odom())
        self._do(self._bridge.start())

    def advance(self) -> None:
        """Turn for one tick."""
        self.now_ns += TICK_NS
        self.sim.advance(self.now_ns)
        self._deliver()
        self._tick()

    def decide(self, event: Event) -> Reply | None:
        """Pass a request or a call to safety; return its answer."""
        reply = self._decide(event)
        if reply:
            self.answers.append((type(event).__name__, reply.done, reply.text))
        return reply

    @property
    def heartbeat(self) -> int:
        """Safety's newest heartbeat."""
        return self._state.heartbeat.number

    # --- bridge ---------------------------------------------------------------------------

    def _deliver(self) -> None:
        for datagram in self.sim.take_sent(self.now_ns):
            port = self._ports.index(datagram.port)
            hit = self._bridge.reflex(datagram.payload)
            if hit is not None:
                self._send(hit.brake)
                self._do(self._bridge.hit(hit, self.now_ns))
            reported = hit is not None
            self._do(self._bridge.datagram(datagram.payload, port, self.now_ns, reported=reported))
        self.records += self.sim.take_records()

    def _do(self, out: Output) -> None:
        """Carry out what the bridge's core returned, as its shell does."""
        for send in out.sends:
            self._send(send)
        for stream, message, _ in out.messages:
            self._take(stream, message)

    def _send(self, send: Send) -> None:
        self.sim.receive(send.datagram, self._ports[send.port], self.now_ns)

    def _take(self, stream: str, message: m.Message) -> None:
        """Pass a message of the bridge on to safety and odometry."""
        if isinstance(message, m.Velocity):
            self._estimator.on_velocity(message, self.now_ns)
        elif isinstance(message, m.Mileage):
            self._estimator.on_mileage(message, self.now_ns)
        self.on_message(stream, message)
        self._keep(**{stream.removeprefix("driver_"): message})
        if stream in ("bumper", "ultrasonic"):
            brake = brake_for_contact(self._state, self._inputs)
            if brake is not None:
                self._move(brake)
            self._decide()

    # --- safety ---------------------------------------------------------------------------

    def _keep(self, **samples: m.Message) -> None:
        latest = {}
        for name, sample in samples.items():
            self._seq[name] += 1
            stamped = replace(sample, seq=self._seq[name], boot=BOOT)
            latest[name] = Latest(stamped, self.now_ns)
        self._inputs = replace(self._inputs, **latest)

    def _decide(self, event: Event | None = None) -> Reply | None:
        inputs = replace(self._inputs, event=event)
        self._state, verdict = self._policy.decide(self._state, inputs, self.now_ns)
        self._move(motion_message(self._state, inputs))
        return verdict.reply

    def _move(self, motion: m.Motion) -> None:
        self._seq["motion"] += 1
        motion = replace(motion, seq=self._seq["motion"], boot=1)
        self._do(self._bridge.motion(motion, self.now_ns, self.now_ns))

    # --- by time --------------------------------------------------------------------------

    def _tick(self) -> None:
        elapsed = (self.now_ns - START_NS) // TICK_NS
        self._tick_bridge(elapsed)
        if elapsed % 2 == 0:
            self._decide()
            estimate = self._estimator.estimate(self.now_ns)
            if estimate is not None:
                self.odometry.append(replace(estimate, mono_ns=self.now_ns))
                self.on_message("odometry", self.odometry[-1])
        if elapsed % 5 == 0:
            beat = self._state.heartbeat.beat(self.now_ns)
            self._state = replace(self._state, heartbeat=beat)
            state = state_message(self._policy, self._state, self.now_ns)
            self.on_message("safety", state)
            for call in self.each_beat:
                call()
        self._deliver()

    def _tick_bridge(self, elapsed: int) -> None:
        self._do(self._bridge.tick(self.now_ns, 0))
        if elapsed % 20 == 0:
            self._do(self._bridge.link(self.now_ns, 0))
        if elapsed % 100 == 0:
            self._do(self._bridge.second())
