"""The bridge as a whole: the board's frames to messages, and the questions that bring them."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from common import keys
from common import messages as m
from common.errors import WireError
from common.freshness import Latest
from common.service import Node
from common.wire import commands, reports
from common.wire.frame import Frame, Side
from common.wire.framing import Framing, Received
from services.bridge.config import Bridge as Settings
from services.bridge.config import BridgeConfig
from services.bridge.handover import Handover, Heartbeat
from services.bridge.mileage import restarted
from services.bridge.operator import Operator
from services.bridge.poll import Poll
from services.bridge.readiness import Readiness
from services.bridge.stamp import Receipt
from services.bridge.timing import Timings
from services.bridge.translate import BumperFilter, Translator, driver
from services.bridge.udp import Sockets
from services.bridge.wheels import Wheels

TICK_S = 0.01
LINK_S = 0.2

Handler = Callable[[Any, bytes, int], None]  # frame, raw bytes, receive time


class Bridge:
    """Reads the board's datagrams in the order of their urgency, and keeps asking."""

    def __init__(self, node: Node[BridgeConfig], handover: Handover | None = None) -> None:
        config = node.config
        self._node = node
        self._framing = Framing(config.wire.crc, config.wire.crc_covers)
        limits = config.bridge.max_linear, config.bridge.max_angular
        self._translator = Translator(config.wire, config.vehicle, *limits)
        self._sockets = Sockets(config.board, handover.sockets if handover else ())
        self._heartbeat = Heartbeat(handover.heartbeat, self._on_no_guard) if handover else None
        self._timings = Timings()
        self._wheels = Wheels(node, self._sockets, self._framing, self._translator, self._timings)
        self._readiness = Readiness(node)
        self._operator = Operator(node, self._readiness, self._wheels.send)
        self._poll = Poll(queries(config.bridge), config.bridge.answer_timeout)
        self._bumper = BumperFilter()
        self._mileage: Latest[m.Mileage] | None = None
        self._faults: dict[Side, int] = {}
        self._rejected: Counter[str] = Counter()
        self._frames: Counter[str] = Counter()
        self._rates: dict[str, float] = {}
        self._hit = self._framing.pack(reports.BumperReport(True))
        # Of the datagram that is being taken in: when it came, and when it was braked for.
        self._receipt = Receipt(None, 0)
        self._braked_ns: int | None = None
        self._told: tuple[object, ...] = ()
        self._publish()
        self._begin()

    def _publish(self) -> None:
        bus = self._node.bus
        self._to_velocity = bus.publisher(keys.VELOCITY)
        self._to_mileage = bus.publisher(keys.MILEAGE)
        self._to_ultrasonic = bus.publisher(keys.ULTRASONIC)
        self._to_bumper = bus.publisher(keys.BUMPER)
        self._to_driver = {
            side: bus.publisher(keys.DRIVER, side=side.name.lower()) for side in Side
        }
        self._to_link = bus.publisher(keys.LINK)
        self._handlers: dict[type[Frame], Handler] = {
            reports.BumperReport: self._on_bumper,
            reports.VelocityReport: self._on_velocity,
            reports.DistanceReport: self._on_distance,
            reports.UltrasonicReport: self._on_ultrasonic,
            reports.DriverReport: self._on_driver,
            reports.UltrasonicBrakeReport: self._on_ultrasonic_brake,
            reports.BumperBrakeReport: self._on_bumper_brake,
            reports.LedReport: self._on_led,
        }

    def _begin(self) -> None:
        loop = self._node.loop
        for sock in self._sockets.sockets:
            loop.watch(sock, self._read)
        loop.every(TICK_S, self._on_tick)
        loop.every(LINK_S, lambda _: self._tell_link())
        loop.every(1.0, self._on_second)
        self._node.timing = self._timings.message
        self._node.at_rest = self._wheels.at_rest
        self._node.last_words = self._last_words

    # --- what comes from the board ----------------------------------------------------------

    def _read(self, now_ns: int) -> None:
        # The active port first: after a pause both have something, and the other one must not
        # take over only because it is looked at first.
        active = self._readiness.link.active
        for port in (active, *(p for p in range(len(self._sockets.sockets)) if p != active)):
            for datagram, ancillary, read_ns in self._sockets.read(port):
                # The reflex, before anything else: a hit that comes alone is known at a glance.
                new = datagram == self._hit and port == active and not self._bumper.pressed
                self._braked_ns = self._wheels.brake() if new else None
                self._receipt = self._sockets.receipt(ancillary, read_ns)
                self._on_datagram(datagram, port, now_ns)
                self._timings.on_read(self._receipt)

    def _on_datagram(self, datagram: bytes, port: int, now_ns: int) -> None:
        if not self._readiness.believes(port, now_ns):
            self._node.counters["other_port"] += 1
            return
        for part in self._framing.read(datagram, reports.FROM_BOARD):
            if isinstance(part, Received):
                self._on_frame(part, port, now_ns)
            else:
                self._rejected[part.reason] += 1

    def _on_frame(self, part: Received, port: int, now_ns: int) -> None:
        frame = part.frame
        try:
            self._handlers[type(frame)](frame, part.raw, now_ns)
        except WireError:
            self._rejected["implausible"] += 1
            return
        self._frames[type(frame).__name__] += 1
        self._wheels.port = port
        self._readiness.on_frame(port, now_ns)

    def _on_bumper(self, frame: reports.BumperReport, raw: bytes, now_ns: int) -> None:
        message, hit = self._bumper.take(frame.on)
        if hit:
            seq = self._to_bumper.next_seq
            self._wheels.on_hit(seq, now_ns, self._receipt, self._braked_ns)
        if message is not None:
            # A short hit stays in the samples until safety has judged one: it may have lost some.
            unjudged = self._wheels.lease.hit is not None
            self._to_bumper.put(m.Bumper(pressed=True) if unjudged else message, raw)
        if hit:
            self._node.event("contact", "error", "the bumper is hit: BREAK")
        self._poll.answered("bumper", now_ns)

    def _on_velocity(self, frame: reports.VelocityReport, raw: bytes, now_ns: int) -> None:
        velocity = self._translator.velocity(frame)
        self._wheels.on_velocity(velocity, now_ns)
        self._to_velocity.put(velocity, raw)

    def _on_distance(self, frame: reports.DistanceReport, raw: bytes, now_ns: int) -> None:
        # Measured after it was asked for, however long it then waited to be read.
        asked_ns = self._poll.answered("mileage", now_ns)
        after = self._translator.mileage(frame, self._readiness.epoch)
        before = self._mileage
        if before is not None and self._is_new_board(before, after, now_ns):
            self._readiness.on_restart(now_ns)
            self._bumper = BumperFilter()
            self._wheels.on_ready(False)  # not only at the next tick: no RUN in between
            after = self._translator.mileage(frame, self._readiness.epoch)
        self._mileage = Latest(after, asked_ns)
        self._to_mileage.put(after, raw)

    def _is_new_board(self, before: Latest[m.Mileage], after: m.Mileage, now_ns: int) -> bool:
        unbroken = self._readiness.link.up_ns <= before.received_ns
        return restarted(before.value, after, before.age_s(now_ns), unbroken=unbroken)

    def _on_ultrasonic(self, frame: reports.UltrasonicReport, raw: bytes, now_ns: int) -> None:
        self._poll.answered("ultrasonic", now_ns)
        self._to_ultrasonic.put(self._translator.ultrasonic(frame), raw)

    def _on_driver(self, frame: reports.DriverReport, raw: bytes, now_ns: int) -> None:
        self._poll.answered(f"driver_{frame.side.name.lower()}", now_ns)
        message = driver(frame)
        if frame.fault_bits != self._faults.get(frame.side, 0):
            side = frame.side.name.lower()
            text = f"{side} motor driver: {', '.join(message.faults) or 'no fault any more'}"
            level: m.Level = "error" if message.faults else "info"
            self._node.event("driver_fault", level, text, side=side, bits=frame.fault_bits)
        self._faults[frame.side] = frame.fault_bits
        self._to_driver[frame.side].put(message, raw)

    def _on_ultrasonic_brake(self, frame: reports.UltrasonicBrakeReport, _: bytes, __: int) -> None:
        self._readiness.on_echo(frame.on, None)

    def _on_bumper_brake(self, frame: reports.BumperBrakeReport, _: bytes, __: int) -> None:
        self._readiness.on_echo(None, frame.on)

    def _on_led(self, frame: reports.LedReport, _: bytes, __: int) -> None:
        self._operator.on_led_echo(frame.done)

    # --- what is due by time ----------------------------------------------------------------

    def _on_tick(self, now_ns: int) -> None:
        # What waits in the sockets came before now: a loop that was held up must not take its own
        # silence for the board's.
        self._read(now_ns)
        due = self._readiness.on_tick(now_ns)
        if self._readiness.link.state != "up":
            self._bumper = BumperFilter()  # what was heard before the gap is no part of a row
        self._wheels.on_ready(self._readiness.ready)
        self._wheels.on_tick(now_ns)
        for frame in (*due, *self._poll.due(now_ns)):
            self._wheels.send(frame)
        self._operator.on_tick(now_ns)
        if self._told != self._link_state():
            self._tell_link()
        if self._heartbeat is not None:
            self._heartbeat.beat(self._wheels.port)

    def _on_no_guard(self) -> None:
        # The two are restarted together: a bridge that nobody guards must not drive.
        self._node.event("guard_gone", "error", "the guard has died: stops the vehicle and ends")
        self._node.loop.stop()

    def _last_words(self) -> None:
        self._wheels.last_words()
        if self._heartbeat is not None:
            self._heartbeat.end()

    def _on_second(self, _: int) -> None:
        self._rates = {name: float(count) for name, count in sorted(self._frames.items())}
        self._frames.clear()
        stranger = self._sockets.last_stranger
        if self._sockets.refused > self._rejected["wrong_address"] and stranger is not None:
            board = self._node.config.board
            self._node.log.warning(
                "datagrams from somebody else are dropped; see board.any_source_port",
                stranger=f"{stranger[0]}:{stranger[1]}",
                board=f"{board.address}:{board.port}",
            )
        self._rejected["wrong_address"] = self._sockets.refused
        self._node.counters["wall_clock_set"] = self._sockets.wall.steps
        for name, count in self._poll.missed().items():
            self._node.counters[f"missed_{name}"] = count

    def _link_state(self) -> tuple[object, ...]:
        waiting = self._readiness.waiting() or self._wheels.lease.waiting
        return self._readiness.link.state, self._readiness.epoch, waiting

    def _tell_link(self) -> None:
        self._told = self._link_state()
        waiting = self._readiness.waiting() or self._wheels.lease.waiting
        board = self._node.config.board
        self._to_link.put(
            m.Link(
                state=self._readiness.link.state,
                board=f"{board.address}:{board.port}",
                epoch=self._readiness.epoch,
                armed=not waiting,
                waiting=waiting,
                rates=self._rates,
                rejected={reason: count for reason, count in self._rejected.items() if count},
                round_trip=self._poll.round_trip_s(),
                latched_by=self._wheels.lease.latched_by,
            )
        )


def queries(settings: Settings) -> list[tuple[str, Frame, float]]:
    """Return what the board is asked, and how often: name, frame, rate in Hz."""
    return [
        ("bumper", commands.BumperQuery(), settings.bumper_rate),
        ("mileage", commands.DistanceQuery(), settings.mileage_rate),
        ("ultrasonic", commands.UltrasonicQuery(), settings.ultrasonic_rate),
        ("driver_left", commands.DriverQuery(Side.LEFT), settings.driver_rate),
        ("driver_right", commands.DriverQuery(Side.RIGHT), settings.driver_rate),
    ]
