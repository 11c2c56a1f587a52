"""The bridge's core: datagrams, motions, calls and ticks in; outputs in their order out. Pure.

================== ============================ ==================================================
entry              called by the shell for      yields
================== ============================ ==================================================
datagram           each datagram of the board   BRAKE for a new hit, before all else; then the
                                                report of the hit; then what its frames lead to
tick               every 20 ms                  STOP or BRAKE if due; queries; events; the link
                                                message, 5 times a second and on a change
second             once a second                the brakes' message
relay_report       a report of the relay        nothing
motions.on_motion  a message on ``@cmd/motion`` the frame that the lease allows
motions.on_estop   an emergency stop            BRAKE
motions.stop,      the end of the process       STOP or BRAKE
motions.on_exit
calls.on_switches, an operator's call           a frame or a refusal; the board's confirmation
calls.on_led                                    answers it later
calls.on_safety    each state of safety         nothing: calls echo its heartbeat
================== ============================ ==================================================

An entry changes the state while its outputs are carried out one by one: take all of them. Times are
of the monotonic clock.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

from common.errors import WireError
from common.freshness import NS_PER_S, Latest
from common.wire import commands, framing, reports
from common.wire.frame import Frame, Side
from common.wire.framing import Received, Rejected
from services.bridge.config import BridgeConfig
from services.bridge.core.calls import Calls
from services.bridge.core.motion_output import MotionOutput
from services.bridge.core.output import Event, Outputs, Publish, Send
from services.bridge.core.polling import Polling
from services.bridge.core.ports import Ports
from services.bridge.core.readiness import Readiness
from services.bridge.core.restart_detection import restarted
from services.bridge.core.translate import Translator, driver
from t2 import keys
from t2 import messages as m
from t2.messages import Field, Phrase
from t2.words import render

Handler = Callable[[Any, bytes, int], Outputs]  # frame, raw bytes, receive time

TICK_S = 0.02  # the lease, the silence of the board and the guard's patience are ten ticks each
LINK_NS = NS_PER_S * 19 // 100  # half a tick less than 0.2 s: the tick that is due may come early
PRESSED = reports.BumperReport(True)
HIT = framing.pack(PRESSED)  # a datagram as the board sends it
# Lower rates would delay the detection of a short hit, a near wall and a restarted board.
QUERIES: tuple[tuple[str, Frame, float], ...] = (
    ("bumper", commands.BumperQuery(), keys.BUMPER.rate_hz),
    ("mileage", commands.DistanceQuery(), keys.MILEAGE.rate_hz),
    ("ultrasonic", commands.UltrasonicQuery(), keys.ULTRASONIC.rate_hz),
    ("driver_left", commands.DriverQuery(Side.LEFT), keys.DRIVER.rate_hz),
    ("driver_right", commands.DriverQuery(Side.RIGHT), keys.DRIVER.rate_hz),
)


class BumperFilter:
    """Debounces the bumper: one sample is a hit, three consecutive samples are clear.

    The header of a frame has no CRC. Make a new filter after a link loss or a restart of the board.
    """

    CLEAR_SAMPLES = 3

    def __init__(self) -> None:
        self.pressed: bool | None = None  # None until the first hit or three clear samples
        self._clear = 0

    def take(self, pressed: bool) -> bool:
        """Process a sample; return whether a hit begins with it."""
        hit = pressed and not self.pressed
        self._clear = 0 if pressed else self._clear + 1
        if pressed or self._clear >= self.CLEAR_SAMPLES:
            self.pressed = pressed
        return hit


class Core:
    """Processes the board's frames, polls it, and sends the commands that the lease allows."""

    def __init__(
        self, config: BridgeConfig, boot: int, counters: Counter[str], now_ns: int
    ) -> None:
        """Set up with the boot of our messages and the counters of the health message."""
        self.rejected: Counter[str] = Counter()  # frames and datagrams, by reason
        self._config, times = config, config.times
        self._counters = counters
        self._translator = Translator(config.wire, config.vehicle)
        self.motions = MotionOutput(
            config, self._translator, boot=boot, counters=counters, now_ns=now_ns
        )
        self.readiness = readiness = Readiness(times, config.board)
        self.calls = Calls(readiness, times.confirmation, self._ask)
        failover_ns = round(times.failover * NS_PER_S)
        self._ports = Ports(len(config.board.listen_ports), failover_ns, now_ns)
        self._polling = Polling(QUERIES, times.answer, TICK_S)
        self._bumper = BumperFilter()
        self._bumper_seq = 0  # of the newest bumper message, as its publisher counts
        self._mileage: Latest[m.Mileage] | None = None
        self._faults: dict[Side, int] = {}
        self._frames: Counter[str] = Counter()  # since the last second
        self._rates: dict[str, float] = {}  # of the last second, in Hz
        self._linked: tuple[object, ...] = ()  # what the newest link message says
        self._linked_ns = 0
        self._handlers: dict[type[Frame], Handler] = {
            reports.VelocityReport: self._on_velocity,
            reports.BumperReport: self._on_bumper,
            reports.DistanceReport: self._on_distance,
            reports.UltrasonicReport: self._on_ultrasonic,
            reports.DriverReport: self._on_driver,
            reports.UltrasonicBrakeReport: lambda frame, *_: readiness.on_confirmation(
                readiness.ultrasonic, frame.on
            ),
            reports.BumperBrakeReport: lambda frame, *_: readiness.on_confirmation(
                readiness.bumper, frame.on
            ),
            reports.LedReport: lambda frame, *_: self.calls.on_led_answer(frame.done),
        }

    # --- input from the board ----------------------------------------------------------

    def datagram(self, datagram: bytes, port: int, now_ns: int) -> Outputs:
        """Process a datagram: BRAKE for a new hit, its report, then the other frames."""
        if datagram == HIT and not self._bumper.pressed:
            yield from self.motions.reflex(now_ns)
        parts = framing.read(datagram, reports.FROM_BOARD)
        hits = [one for one in parts if isinstance(one, Received) and one.frame == PRESSED]
        hit = hits[0] if hits and not self._bumper.pressed else None
        if hit is not None:
            yield from self._on_frame(hit, port, now_ns)
        for part in parts:
            if isinstance(part, Rejected):
                self.rejected[part.reason] += 1
            elif part is hit:
                self._bumper.take(True)  # clear samples before it do not count
            else:
                yield from self._on_frame(part, port, now_ns)

    def _on_frame(self, part: Received, port: int, now_ns: int) -> Outputs:
        frame, kind = part.frame, type(part.frame)
        if not self._ports.takes(kind, port, now_ns, urgent=self._is_urgent(frame)):
            self._counters["other_port"] += 1
            if frame == PRESSED:
                self._bumper.take(True)  # clear samples count only if neither port shows a hit
            return
        try:
            yield from self._handlers[kind](frame, part.raw, now_ns)
        except WireError:
            self.rejected["implausible"] += 1
            return
        self._frames[kind.__name__] += 1
        yield from self.readiness.on_frame(now_ns)
        if not self.readiness.ready:
            self.motions.on_ready(False)  # now, not at the next tick: no RUN in between
        if self.motions.port != self._ports.main:
            self.motions.port = self._ports.main
            number = self._config.board.listen_ports[port]
            yield Event("port_changed", "warning", {"port": number})

    def _is_urgent(self, frame: Frame) -> bool:
        """Return whether a frame counts from either port: a new hit or fault, or a brake as off."""
        match frame:
            case reports.BumperReport(on=True):
                return not self._bumper.pressed
            case reports.DriverReport(side=side, fault_bits=bits):
                return bool(bits & ~self._faults.get(side, 0))
            case reports.UltrasonicBrakeReport(on=False) | reports.BumperBrakeReport(on=False):
                return True
        return False

    def _on_velocity(self, frame: reports.VelocityReport, raw: bytes, now_ns: int) -> Outputs:
        velocity = self._translator.velocity(frame)
        self.motions.on_velocity(velocity, now_ns)
        yield Publish("velocity", velocity, raw)

    def _on_ultrasonic(self, frame: reports.UltrasonicReport, raw: bytes, now_ns: int) -> Outputs:
        self._polling.answered("ultrasonic", now_ns)
        yield Publish("ultrasonic", self._translator.ultrasonic(frame), raw)

    def _on_bumper(self, frame: reports.BumperReport, raw: bytes, now_ns: int) -> Outputs:
        hit = self._bumper.take(frame.on)
        if hit:
            yield from self.motions.on_hit(self._bumper_seq + 1, now_ns)
        self._polling.answered("bumper", now_ns)
        if self._bumper.pressed is not None:
            self._bumper_seq += 1
            # A short hit stays in the samples until safety has acknowledged one: some may be lost.
            pressed = self._bumper.pressed or self.motions.lease.hit is not None
            yield Publish("bumper", m.Bumper(pressed=pressed), raw)
        if hit:
            yield Event("contact", "error")

    def _on_distance(self, frame: reports.DistanceReport, raw: bytes, now_ns: int) -> Outputs:
        asked_ns = self._polling.answered("mileage", now_ns)  # the answer may be read late
        after = self._translator.mileage(frame, self.readiness.epoch)
        before = self._mileage
        if before is not None and restarted(
            before.value,
            after,
            before.age_s(now_ns),
            unbroken=self.readiness.unbroken_since(before.received_ns),
            silent=self.readiness.was_silent_since(before.received_ns, now_ns),
        ):
            yield from self.readiness.on_restart(now_ns)
            self._bumper = BumperFilter()
            self.motions.on_ready(False)  # also where a firmware that confirms nothing stays ready
            after = self._translator.mileage(frame, self.readiness.epoch)
        self._mileage = Latest(after, asked_ns)
        self.motions.on_mileage(after, now_ns)
        yield Publish("mileage", after, raw)

    def _on_driver(self, frame: reports.DriverReport, raw: bytes, now_ns: int) -> Outputs:
        side = frame.side.name.lower()
        self._polling.answered(f"driver_{side}", now_ns)
        message = driver(frame)
        if frame.fault_bits != self._faults.get(frame.side, 0):
            level: m.Level = "error" if message.faults else "info"
            name = "driver.faults" if message.faults else "driver.no_fault"
            phrase = Phrase(name, {"side": side, "faults": message.faults})
            about: dict[str, Field] = {"side": side, "bits": frame.fault_bits}
            yield Event("driver_fault", level, about, (phrase,))
        self._faults[frame.side] = frame.fault_bits
        yield Publish(f"driver_{side}", message, raw)

    def relay_report(self, report: bytes, now_ns: int) -> None:
        """Process a report of the relay."""
        if not self.readiness.relay.take(report, now_ns):
            self.rejected["relay_report"] += 1

    # --- timers ----------------------------------------------------------------

    def tick(self, now_ns: int) -> Outputs:
        """Yield what is due."""
        yield from self.readiness.on_tick(now_ns)
        if self.readiness.link != "up":
            self._bumper = BumperFilter()  # samples from before the gap do not count as consecutive
        frames = (*self.readiness.due(now_ns), *self._polling.due(now_ns))
        self.motions.on_ready(self.readiness.ready)
        yield from self.motions.on_tick(now_ns)
        for frame in frames:
            yield self._ask(frame, now_ns)
        yield from self.readiness.changes()
        yield from self.calls.on_tick(now_ns)
        if self._link_state() != self._linked or now_ns - self._linked_ns >= LINK_NS:
            yield Publish("link", self.link(now_ns))

    def _ask(self, frame: Frame, now_ns: int) -> Send:
        """Return a query or a setting, from the port that receives answers."""
        return Send(framing.pack(frame), self._ports.to_ask(now_ns))

    def second(self) -> Outputs:
        """Update the rates and counters of the last second; publish the brakes."""
        self._rates = {name: float(count) for name, count in sorted(self._frames.items())}
        self._frames.clear()
        yield Publish("switches", self.readiness.message())

    # --- the link message ----------------------------------------------------------------

    def link(self, now_ns: int) -> m.Link:
        """Return the link message: rates, rejected frames, and why a RUN would be refused."""
        self._linked, self._linked_ns = self._link_state(), now_ns
        waiting = self._waiting()
        board, streams = self._config.board, self._ports.streams
        return m.Link(
            state=self.readiness.link,
            board=f"{board.address}:{board.port}",
            epoch=self.readiness.epoch,
            armed=not waiting,
            waiting=render(waiting),
            waiting_phrases=waiting,
            rates=self._rates,
            rejected={reason: count for reason, count in self.rejected.items() if count},
            round_trip=self._polling.round_trip_s(),
            latched_by=self.motions.lease.latched_by,
            ports={k.__name__: board.listen_ports[each.port] for k, each in streams.items()},
            send_errors=self._counters["send_errors"],
            relay=self.readiness.relay.message(),
            estop=self.motions.lease.estop,
        )

    def _link_state(self) -> tuple[object, ...]:
        return self.readiness.link, self.readiness.epoch, self._waiting()

    def _waiting(self) -> m.Phrases:
        """Describe why a RUN would be refused; empty when it would be obeyed."""
        return self.readiness.waiting() or self.motions.lease.waiting
