"""Motion output: the lease's orders as frames, and the standstill after its end. Pure.

STOP coasts, and the board may not obey it. So the bridge supervises it while no safety commands:

=========== ==================================== ===================================================
phase       ends with                            BRAKE
=========== ==================================== ===================================================
stopping    a velocity that counts as standstill no standstill after v / a + 0.5 s, or after the
                                                 coast limit if that is sooner
standstill  a valid lease                        the vehicle has left its place
                                                 (``common.standstill``)
=========== ==================================== ===================================================

The first BRAKE lasts until standstill, the second one until safety has latched it (see ``lease``).
"""

from collections import Counter

from common.freshness import NS_PER_S, Latest, fresh
from common.motion import BRAKE, RUN, STOP, Twist
from common.standstill import Displacement, stopping_ns
from common.wire import framing
from common.wire.commands import MotionCommand, MotionKind
from services.bridge.config import BridgeConfig
from services.bridge.core import lease as leases
from services.bridge.core.lease import Lease, Refusal
from services.bridge.core.output import Event, Outputs, Reacted, Send
from services.bridge.core.translate import Translator
from t2.messages import Command, Mileage, Motion, Velocity

# Packed once: BRAKE must not wait for it.
RESTING = {
    STOP: framing.pack(MotionCommand(MotionKind.STOP)),
    BRAKE: framing.pack(MotionCommand(MotionKind.BREAK)),
}
STOP_TIMEOUT_NS = NS_PER_S  # until a stopping bridge no longer waits for standstill


class MotionOutput:
    """Sends the commands of ``@cmd/motion`` that the lease allows, otherwise STOP or BRAKE."""

    def __init__(
        self,
        config: BridgeConfig,
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
        self._translator = translator
        self._counters = counters
        self._velocity: Latest[Twist] | None = None
        self._hit_ns = 0  # when the hit was read that the lease waits for
        self._has_braked = False  # for a hit that ``on_hit`` has not taken yet
        self._stopping_ns: int | None = None
        self._refused: int | None = None  # ``boot`` of the second authority that was reported
        self._vehicle, self._times = config.vehicle, config.times
        self._valid_ns = round(self._times.lease * NS_PER_S)
        self._over_since_ns: int | None = None  # the end of the lease that is supervised
        self._limit_ns = round(self._times.coast * NS_PER_S)  # from then until it must stand
        self._displacement: Displacement | None = None  # None until standstill after that end

    def on_motion(self, motion: Motion, received_ns: int, now_ns: int) -> Outputs:
        """Process a motion message and send one frame."""
        before = self.lease
        self.lease, order, refusal = leases.on_motion(
            before, motion, now_ns, self._valid_ns, self._boot, received_ns=received_ns
        )
        if order is not None:
            yield self.order(order, motion)
        if order is BRAKE and before.hit is not None and self.lease.hit is None:
            yield Reacted("judged_stop", self._hit_ns)
        if refusal is not None:
            self._counters[f"motion_{refusal}"] += 1
        if refusal is Refusal.SECOND_AUTHORITY and motion.boot != self._refused:
            self._refused = motion.boot
            yield Event("second_authority", "error", {"boot": motion.boot})

    def reflex(self, now_ns: int) -> tuple[Send, Reacted]:
        """Brake for a hit before its datagram is processed; then ``on_hit``."""
        self._hit_ns, self._has_braked = now_ns, True
        return self.order(BRAKE), Reacted("reflex", now_ns)

    def on_hit(self, seq: int, now_ns: int) -> Outputs:
        """Hold BRAKE for a hit until safety has judged the sample that is published as ``seq``."""
        if not self._has_braked:  # its datagram holds more than the hit
            yield from self.reflex(now_ns)
        self._has_braked = False
        self.lease = leases.on_hit(self.lease, seq, now_ns)

    def on_estop(self, received_ns: int) -> Outputs:
        """Process an emergency stop."""
        self.lease, order = leases.on_estop(self.lease, received_ns)
        if order is not None:
            yield self.order(order)

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Process a measured velocity."""
        measured = Latest(Twist(velocity.linear, velocity.angular), now_ns)
        self._velocity = measured
        if self._over_since_ns is None:
            return
        if self._displacement is not None:
            self._displacement = self._displacement.with_velocity(measured)
        elif measured.value.is_standing:
            self._displacement = Displacement()

    def on_mileage(self, mileage: Mileage, now_ns: int) -> None:
        """Process the board's counters."""
        if self._displacement is not None:
            self._displacement = self._displacement.with_mileage(Latest(mileage, now_ns))

    def on_ready(self, ready: bool) -> None:
        """Set whether the board may be driven."""
        self.lease = leases.on_ready(self.lease, ready and self._stopping_ns is None)

    def on_tick(self, now_ns: int) -> Outputs:
        """Send the order that is due."""
        if self._displacement is not None and self._displacement.has_left:
            self.lease, order = leases.on_uncommanded(self.lease, now_ns, self._boot)
            if order is not None:
                yield self.order(order)
                yield Event("uncommanded_motion", "error")
        self.lease, order = leases.on_tick(
            self.lease, now_ns, self._valid_ns, self._limit_ns, self._standing(now_ns)
        )
        self._supervise(self.lease.over_since_ns)
        if order is not None:
            yield self.order(order)

    def _supervise(self, over_since_ns: int | None) -> None:
        """Begin anew with each end of a lease; None while it is valid."""
        if over_since_ns == self._over_since_ns:
            return
        self._over_since_ns = over_since_ns
        self._displacement = None
        times, vehicle, velocity = self._times, self._vehicle, self._velocity
        self._limit_ns = round(times.coast * NS_PER_S)
        if velocity and over_since_ns and fresh(velocity, over_since_ns, times.silence):
            limit_ns = stopping_ns(
                velocity.value, vehicle.deceleration, vehicle.angular_deceleration
            )
            self._limit_ns = min(self._limit_ns, limit_ns)

    def stop(self, now_ns: int) -> Outputs:
        """Stop the vehicle before exit; only the first call sends a frame."""
        if self._stopping_ns is None:
            self._stopping_ns = now_ns
            self.on_ready(False)
            yield self.order(BRAKE if self.lease.braking else STOP)

    def is_stopped(self, now_ns: int) -> bool:
        """Return whether the vehicle is at standstill after ``stop``, or a second has passed."""
        since_ns = now_ns if self._stopping_ns is None else self._stopping_ns
        return self._is_at_standstill(now_ns) or now_ns - since_ns > STOP_TIMEOUT_NS

    def on_exit(self, now_ns: int) -> Send:
        """Return the last frame, on every exit: STOP at standstill, unless BRAKE held it there."""
        stands = self._is_at_standstill(now_ns) and not self.lease.braking
        return self.order(STOP if stands else BRAKE)

    def order(self, order: Command, motion: Motion | None = None) -> Send:
        """Return the frame of an order, from the command port; a RUN needs its motion."""
        if order is RUN and motion is not None:
            datagram = framing.pack(self._translator.run(motion))
        else:
            datagram = RESTING[order]
        return Send(datagram, self.port, order)

    def _is_at_standstill(self, now_ns: int) -> bool:
        """Return whether standstill was measured after ``stop``."""
        since_ns, velocity = self._stopping_ns, self._velocity
        if since_ns is None or velocity is None or velocity.received_ns <= since_ns:
            return False
        return self._standing(now_ns)

    def _standing(self, now_ns: int) -> bool:
        """Return whether the measured velocity shows standstill; False if it is too old.

        Without any velocity so far it is True: this bridge has commanded no motion yet.
        """
        velocity = self._velocity
        if velocity is None:
            return True
        return velocity.value.is_standing and fresh(velocity, now_ns, self._times.silence)
