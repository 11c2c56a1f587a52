"""The bridge's core: datagrams, motions, calls and ticks in; frames, messages and events out. Pure.

========== ================================== ==================================================
entry      called by the shell for            returns
========== ================================== ==================================================
reflex     each datagram, first               BRAKE, when it holds a new bumper hit
hit        that hit, once BRAKE is sent       the bumper message; an event
datagram   the same datagram                  messages; answers of calls; events
motion     each message on ``@cmd/motion``    the frame that the lease allows
estop      an emergency stop                  BRAKE
switches   an operator's call; likewise led   frames; the board's echo answers them later
tick       every 20 ms                        queries; STOP or BRAKE if due; events
second     once a second                      the switches' message; rates for the link message
link       5 times a second, and on a change  the link message
stop, exit the end of the process             STOP or BRAKE
========== ================================== ==================================================

Each entry but ``reflex`` returns an ``Output``. Times are of the monotonic clock.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

from common import messages as m
from common.errors import WireError
from common.freshness import Latest
from common.motion import Command
from common.wire import reports
from common.wire.frame import OPENING, Frame, Side
from common.wire.framing import Framing, Received
from services.bridge.config import ANSWERS, ASKED, STEADY, BridgeConfig, ports_of, queries, tick_s
from services.bridge.link_report import LinkReport
from services.bridge.motion_output import MotionOutput
from services.bridge.operator import Operator
from services.bridge.output import Output
from services.bridge.poll import Poll
from services.bridge.ports import BRAKE_REPORTS, URGENT_KINDS
from services.bridge.readiness import Readiness
from services.bridge.reflex import Hit, Reflex
from services.bridge.restart_detection import restarted
from services.bridge.translate import BumperFilter, Translator, driver

Handler = Callable[[Any, bytes, int, Output], None]  # frame, raw bytes, receive time
# Continuous frames: a change of their port is an event.
POLLED = frozenset((reports.VelocityReport, *ASKED.values(), reports.DriverReport))


class Core:
    """Processes the board's frames, polls it, and sends the commands that the lease allows."""

    def __init__(
        self, config: BridgeConfig, boot: int, counters: Counter[str], now_ns: int
    ) -> None:
        """Set up with the boot of our messages and the counters of dropped input."""
        self._config, settings = config, config.bridge
        self._counters = counters
        self._framing = Framing(config.wire.crc, config.wire.crc_covers)
        limits = settings.max_linear, settings.max_angular
        self._translator = Translator(config.wire, config.vehicle, *limits)
        self.motions = MotionOutput(
            settings, self._framing, self._translator, boot=boot, counters=counters, now_ns=now_ns
        )
        self.readiness = Readiness(settings, config.board)
        self.operator = Operator(self.readiness, settings.echo_timeout)
        self._ports = ports_of(config, now_ns)
        self._poll = Poll(queries(settings), settings.answer_timeout, STEADY, tick_s(settings))
        self._bumper = BumperFilter()
        self._bumper_seq = 0  # of the newest bumper message
        self._lost = 0  # bumper polls lost, at the newest sample
        self._mileage: Latest[m.Mileage] | None = None
        self._faults: dict[Side, int] = {}
        parts = self.readiness, self.motions, self._ports, self._poll
        self.report = LinkReport(config.board, *parts)
        echo = self.readiness.on_echo
        self._handlers: dict[type[Frame], Handler] = {
            reports.VelocityReport: self._on_velocity,
            reports.BumperReport: self._on_bumper,
            reports.DistanceReport: self._on_distance,
            reports.UltrasonicReport: self._on_ultrasonic,
            reports.DriverReport: self._on_driver,
            reports.UltrasonicBrakeReport: lambda frame, _, __, out: echo(frame.on, None, out),
            reports.BumperBrakeReport: lambda frame, _, __, out: echo(None, frame.on, out),
            reports.LedReport: lambda frame, _, __, out: self.operator.on_led_echo(frame.done, out),
        }
        self._reflex = Reflex(self._framing)

    # --- input from the board ----------------------------------------------------------

    def reflex(self, datagram: bytes) -> Hit | None:
        """Return the hit with its BRAKE when a datagram, on either port, holds a new one."""
        if self._bumper.pressed:
            return None
        return self._reflex.answer(datagram, self.motions.port)

    def hit(self, hit: Hit, now_ns: int) -> Output:
        """Report a hit of ``reflex``, before the rest of its datagram is read."""
        out = Output()
        self._bumper.take(True)
        self._report_hit(hit.raw, now_ns, out)
        return out

    def _report_hit(self, raw: bytes, now_ns: int, out: Output) -> None:
        self._bumper_seq += 1
        out.hit = self._bumper_seq
        self.motions.on_hit(out.hit, now_ns)
        out.publish("bumper", m.Bumper(pressed=True, lost=self._lost), raw)
        out.event("contact", "error", "the bumper is hit: BRAKE")

    def datagram(self, datagram: bytes, port: int, now_ns: int, *, reported: bool) -> Output:
        """Process a datagram received on this port; ``reported``: ``hit`` handled its hit."""
        out = Output(reported=reported)
        if port != self._ports.main and self._is_copy(datagram, port, now_ns):
            self._counters["other_port"] += 1
            return out
        for part in self._framing.read(datagram, reports.FROM_BOARD):
            if isinstance(part, Received):
                self._on_frame(part, port, now_ns, out)
            else:
                self.report.rejected[part.reason] += 1
        return out

    def _is_copy(self, datagram: bytes, port: int, now_ns: int) -> bool:
        """Return whether a datagram is one non-urgent frame that the active port delivers too."""
        kind = reports.FROM_BOARD.get(datagram[: OPENING.size])
        return (
            kind is not None
            and len(datagram) == kind.size
            and kind.frame not in URGENT_KINDS
            and not self._ports.takes(kind.frame, port, now_ns)
        )

    def _on_frame(self, part: Received, port: int, now_ns: int, out: Output) -> None:
        frame, kind = part.frame, type(part.frame)
        news = kind in URGENT_KINDS and self._is_urgent(frame, out)
        if not (self._ports.takes(kind, port, now_ns) or news):
            self._counters["other_port"] += 1
            return
        try:
            self._handlers[kind](frame, part.raw, now_ns, out)
        except WireError:
            self.report.rejected["implausible"] += 1
            return
        self.report.frames[kind.__name__] += 1
        self.readiness.on_frame(now_ns, out)
        if not self.readiness.ready:
            self.motions.on_ready(False)  # now, not at the next tick: no RUN in between
        changed = self._ports.take(kind, port, now_ns)
        self.motions.port = self._ports.main
        if changed and kind in POLLED:
            number = self._config.board.listen_ports[port]
            text = f"{kind.__name__} is now taken from UDP port {number}"
            out.event("port_changed", "warning", text, port=number, frame=kind.__name__)

    def _is_urgent(self, frame: Frame, out: Output) -> bool:
        """Return whether a frame on either port reports a new hit or fault, or a brake as off."""
        if isinstance(frame, BRAKE_REPORTS):
            return not frame.on
        if isinstance(frame, reports.DriverReport):
            return bool(frame.fault_bits & ~self._faults.get(frame.side, 0))
        if not isinstance(frame, reports.BumperReport) or not frame.on:
            return False
        if self._bumper.pressed and not out.reported:
            self._bumper.take(True)  # a hit on either port restarts the count of clear samples
            return False
        return True

    def _on_velocity(
        self, frame: reports.VelocityReport, raw: bytes, now_ns: int, out: Output
    ) -> None:
        velocity = self._translator.velocity(frame)
        self.motions.on_velocity(velocity, now_ns)
        out.publish("velocity", velocity, raw)

    def _on_ultrasonic(
        self, frame: reports.UltrasonicReport, raw: bytes, now_ns: int, out: Output
    ) -> None:
        self._poll.answered("ultrasonic", now_ns)
        out.publish("ultrasonic", self._translator.ultrasonic(frame), raw)

    def _on_bumper(self, frame: reports.BumperReport, raw: bytes, now_ns: int, out: Output) -> None:
        message, hit = self._bumper.take(frame.on)
        self._poll.answered("bumper", now_ns)
        self._lost = self._poll.lost("bumper", now_ns)
        if out.reported and frame.on:
            out.reported = False
        elif hit:
            out.sends.append(self.motions.brake())
            self._report_hit(raw, now_ns, out)
        elif message is not None:
            # A short hit stays in the samples until safety has acknowledged one: some may be lost.
            pressed = message.pressed or self.motions.lease.hit is not None
            self._bumper_seq += 1
            out.publish("bumper", m.Bumper(pressed=pressed, lost=self._lost), raw)

    def _on_distance(
        self, frame: reports.DistanceReport, raw: bytes, now_ns: int, out: Output
    ) -> None:
        asked_ns = self._poll.answered("mileage", now_ns)  # the answer may be read late
        after = self._translator.mileage(frame, self.readiness.epoch)
        before = self._mileage
        if before is not None and restarted(
            before.value,
            after,
            before.age_s(now_ns),
            unbroken=self.readiness.link.up_ns <= before.received_ns,
            silent=self.readiness.gap_ns > before.received_ns,
        ):
            self.readiness.on_restart(now_ns, out)
            self._bumper = BumperFilter()
            self.motions.on_ready(False)  # also where a firmware without echoes stays ready
            after = self._translator.mileage(frame, self.readiness.epoch)
        self._mileage = Latest(after, asked_ns)
        self.motions.on_mileage(after, now_ns)
        out.publish("mileage", after, raw)

    def _on_driver(self, frame: reports.DriverReport, raw: bytes, now_ns: int, out: Output) -> None:
        side = frame.side.name.lower()
        self._poll.answered(f"driver_{side}", now_ns)
        message = driver(frame)
        if frame.fault_bits != self._faults.get(frame.side, 0):
            text = f"{side} motor driver: {', '.join(message.faults) or 'no fault'}"
            level: m.Level = "error" if message.faults else "info"
            out.event("driver_fault", level, text, side=side, bits=frame.fault_bits)
        self._faults[frame.side] = frame.fault_bits
        out.publish(f"driver_{side}", message, raw)

    # --- input from the bus ------------------------------------------------------------

    def motion(self, motion: m.Motion, received_ns: int, now_ns: int) -> Output:
        """Process a motion message of safety."""
        out = Output()
        self.motions.on_motion(motion, received_ns, now_ns, out)
        return out

    def estop(self, received_ns: int) -> Output:
        """Process an emergency stop."""
        out = Output()
        self.motions.on_estop(received_ns, out)
        return out

    def switches(self, request: m.SwitchesRequest, caller: Any, now_ns: int) -> Output:
        """Process a call that sets the board's emergency brakes; the answer names ``caller``."""
        out = Output()
        self.operator.on_switches(request, caller, now_ns, out)
        return out

    def led(self, request: m.LedRequest, caller: Any, now_ns: int) -> Output:
        """Process a call that sets a lamp channel; the answer names ``caller``."""
        out = Output()
        if frame := self.operator.on_led(request, caller, now_ns, out):
            self._ask(frame, now_ns, out)
        return out

    # --- timers ----------------------------------------------------------------

    def start(self) -> Output:
        """Return the first frame: STOP."""
        out = Output()
        self.motions.order(Command.STOP, out)
        return out

    def tick(self, now_ns: int, send_errors: int) -> Output:
        """Send what is due; ``send_errors``: datagrams that the system did not send."""
        out = Output()
        frames = self.readiness.on_tick(now_ns, out)
        if self.readiness.link.state != "up":
            self._bumper = BumperFilter()  # samples from before the gap do not count as consecutive
        self.motions.on_ready(self.readiness.ready)
        self.motions.on_tick(now_ns, out)
        for frame in (*frames, *self._poll.due(now_ns)):
            self._ask(frame, now_ns, out)
        self.operator.on_tick(now_ns, out)
        if self.report.is_due(now_ns):
            self.report.publish(now_ns, send_errors, out)
        return out

    def second(self) -> Output:
        """Update the rates of the last second; publish the switches."""
        out = Output()
        self.report.second()
        for name, count in self._poll.missed().items():
            self._counters[f"missed_{name}"] = count
        out.publish("switches", self.readiness.message())
        return out

    def link(self, now_ns: int, send_errors: int) -> Output:
        """Publish the state of the link to the board."""
        out = Output()
        self.report.publish(now_ns, send_errors, out)
        return out

    def _ask(self, frame: Frame, now_ns: int, out: Output) -> None:
        """Send a query or a setting from the port that receives its answers."""
        self.motions.send(frame, self._ports.to_ask(ANSWERS[frame.ID], now_ns), out)

    def stop(self, now_ns: int) -> Output:
        """Stop the vehicle before exit; ``motions.is_stopped`` reports standstill."""
        out = Output()
        self.motions.stop(now_ns, out)
        return out

    def exit(self, now_ns: int) -> Output:
        """Return the last frame: STOP at standstill, otherwise BRAKE."""
        out = Output()
        self.motions.on_exit(now_ns, out)
        return out
