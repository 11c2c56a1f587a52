"""Motion output: the lease's orders as frames, from the command port. Pure."""

from collections import Counter

from common.codec import finite
from common.freshness import NS_PER_S
from common.messages import Mileage, Motion, Velocity
from common.motion import BRAKE, RUN, STOP, Command, is_standing
from common.wire.frame import Frame
from common.wire.framing import Framing
from services.bridge import lease
from services.bridge.config import Bridge as Settings
from services.bridge.lease import Lease, Refusal
from services.bridge.output import Output, Send
from services.bridge.standstill import Standstill
from services.bridge.translate import Translator

REPORTED_MAX = 20  # limit: a sender that keeps changing its boot must not fill memory and events
STOP_TIMEOUT_NS = NS_PER_S  # until a stopping bridge no longer waits for standstill


class MotionOutput:
    """Sends the commands of ``@cmd/motion`` that the lease allows, otherwise STOP or BRAKE."""

    def __init__(
        self,
        settings: Settings,
        framing: Framing,
        translator: Translator,
        *,
        boot: int,
        counters: Counter[str],
        now_ns: int,
    ) -> None:
        """Set up with the bridge's own ``boot`` and the counters of refused motions."""
        self.lease = Lease(over_since_ns=now_ns)
        self.port = 0
        self._boot = boot
        self._framing = framing
        self._translator = translator
        self._counters = counters
        self._brake = framing.pack(translator.command(BRAKE))
        self._velocity: tuple[Velocity, int] | None = None
        self._stopping_ns: int | None = None
        # Refused senders already reported by an event.
        self._reported: set[tuple[Refusal, int]] = set()
        self._lease_ns = round(settings.lease * NS_PER_S)
        self._silence_ns = round(settings.silence * NS_PER_S)
        self._standstill = Standstill(
            settings.deceleration,
            settings.angular_deceleration,
            round(settings.coast * NS_PER_S),
            self._silence_ns,
        )

    def on_motion(self, motion: Motion, received_ns: int, now_ns: int, out: Output) -> None:
        """Process a motion message and send one frame."""
        if motion.command is RUN and not finite(motion.linear, motion.angular):
            self._counters["motion_not_finite"] += 1
            out.warnings.append(
                f"motion of {motion.linear} m/s, {motion.angular} rad/s is not finite"
            )
            return
        hit = self.lease.hit
        self.lease, order, refusal = lease.on_motion(
            self.lease, motion, now_ns, self._lease_ns, self._boot, received_ns=received_ns
        )
        if order is not None:
            self.order(order, out, motion)
            out.acked = hit is not None and self.lease.hit is None and order is BRAKE
        if refusal is not None:
            self._report(refusal, motion, out)

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Process a measured velocity."""
        self._velocity = velocity, now_ns
        self._standstill.on_velocity(velocity, now_ns)

    def on_mileage(self, mileage: Mileage, now_ns: int) -> None:
        """Process the board's counters."""
        self._standstill.on_mileage(mileage, now_ns)

    def brake(self) -> Send:
        """Return a BRAKE frame."""
        return Send(self._brake, self.port, BRAKE)

    def on_hit(self, seq: int, now_ns: int) -> None:
        """Process a hit, in the sample that will be published as ``seq``."""
        self.lease, _ = lease.on_hit(self.lease, seq, now_ns)

    def on_estop(self, received_ns: int, out: Output) -> None:
        """Process an emergency stop."""
        self.lease, order = lease.on_estop(self.lease, received_ns)
        if order is not None:
            self.order(order, out)

    def on_ready(self, ready: bool) -> None:
        """Set whether the board may be driven."""
        self.lease = lease.on_ready(self.lease, ready and self._stopping_ns is None)

    def on_tick(self, now_ns: int, out: Output) -> None:
        """Send the order that is due."""
        limit_ns, standing = self._standstill.limit_ns, self._standing(now_ns)
        self.lease, order = lease.on_tick(self.lease, now_ns, self._lease_ns, limit_ns, standing)
        self._standstill.on_lease(self.lease.over_since_ns)
        if self._standstill.moved_away:
            self._on_uncommanded(now_ns, out)
        if order is not None:
            self.order(order, out)

    def _on_uncommanded(self, now_ns: int, out: Output) -> None:
        self.lease, order = lease.on_uncommanded(self.lease, now_ns, self._boot)
        if order is not None:
            self.order(order, out)
            text = "moved from standstill without a command: BRAKE"
            out.event("uncommanded_motion", "error", text)

    def stop(self, now_ns: int, out: Output) -> None:
        """Stop the vehicle before exit; only the first call sends a frame."""
        if self._stopping_ns is None:
            self._stopping_ns = now_ns
            self.on_ready(False)
            self.order(BRAKE if self.lease.braking else STOP, out)

    def is_stopped(self, now_ns: int) -> bool:
        """Return whether the vehicle is at standstill after ``stop``, or a second has passed."""
        since_ns = now_ns if self._stopping_ns is None else self._stopping_ns
        return self._is_at_standstill(now_ns) or now_ns - since_ns > STOP_TIMEOUT_NS

    def on_exit(self, now_ns: int, out: Output) -> None:
        """Send the last frame, on every exit: the board does not stop by itself."""
        self.order(STOP if self._is_at_standstill(now_ns) else BRAKE, out)

    def _is_at_standstill(self, now_ns: int) -> bool:
        """Return whether standstill was measured after ``stop``."""
        measured_ns = self._velocity[1] if self._velocity else 0
        stopped = self._stopping_ns is not None and measured_ns > self._stopping_ns
        return stopped and self._standing(now_ns)

    def send(self, frame: Frame, port: int, out: Output) -> None:
        """Send a query or a setting to the board."""
        out.sends.append(Send(self._framing.pack(frame), port))

    def order(self, order: Command, out: Output, motion: Motion | None = None) -> None:
        """Send the frame of an order."""
        if order is BRAKE:
            out.sends.append(self.brake())
            return
        datagram = self._framing.pack(self._translator.command(order, motion))
        out.sends.append(Send(datagram, self.port, order))

    def _standing(self, now_ns: int) -> bool:
        """Return whether the measured velocity shows standstill; False if it is too old.

        Without any velocity so far it is True: this bridge has commanded no motion yet.
        """
        if self._velocity is None:
            return True
        velocity, measured_ns = self._velocity
        fresh = now_ns - measured_ns <= self._silence_ns
        return fresh and is_standing(velocity.linear, velocity.angular)

    def _report(self, refusal: Refusal, motion: Motion, out: Output) -> None:
        self._counters[f"motion_{refusal}"] += 1
        if refusal not in (Refusal.JUMP, Refusal.SECOND_AUTHORITY):
            return
        if len(self._reported) >= REPORTED_MAX or (refusal, motion.boot) in self._reported:
            return
        self._reported.add((refusal, motion.boot))
        if refusal is Refusal.JUMP:
            text = "a motion whose seq jumps is refused; its sender may be a copy"
            out.event("seq_jump", "error", text, boot=motion.boot)
        else:
            text = "a second sender on @cmd/motion is refused"
            out.event("second_authority", "error", text, boot=motion.boot)
