"""What reaches the wheels: the lease's orders as frames, from the port that is active."""

import time

from common import keys
from common.bus.bus import Arrival
from common.errors import MessageError
from common.freshness import S
from common.messages import Motion, Velocity
from common.service import Node
from common.wire.frame import Frame
from common.wire.framing import Framing
from services.bridge import lease
from services.bridge.config import BridgeConfig
from services.bridge.lease import Lease, Order, Refusal
from services.bridge.stamp import Receipt
from services.bridge.timing import Timings
from services.bridge.translate import Translator, check_finite
from services.bridge.udp import Sockets

RIVALS_MAX = 20  # a sender that changes its boot all the time must not fill memory and events
REST_NS = S  # how long a stopping bridge waits for the vehicle to stand


class Wheels:
    """Obeys ``@cmd/motion`` as far as the lease allows; STOP is always on the way."""

    def __init__(
        self,
        node: Node[BridgeConfig],
        sockets: Sockets,
        framing: Framing,
        translator: Translator,
        timings: Timings,
    ) -> None:
        self.lease = Lease(over_since_ns=time.monotonic_ns())
        self.port = 0
        self._node = node
        self._sockets = sockets
        self._framing = framing
        self._translator = translator
        self._timings = timings
        self._brake = framing.pack(translator.command(Order.BRAKE))
        self._velocity: tuple[Velocity, int] | None = None
        self._stopping_ns: int | None = None
        self._rivals: set[int] = set()  # second senders that were told of already
        self._lease_ns = round(node.config.bridge.lease * S)
        self._silence_ns = round(node.config.bridge.silence * S)
        self._coast_ns = round(node.config.bridge.coast * S)
        self._order(Order.STOP)
        node.bus.subscribe(keys.MOTION, self.on_motion, depth=8)

    def on_motion(self, arrival: Arrival[Motion]) -> None:
        """Turn one motion message into one frame, at once."""
        motion = arrival.message
        try:
            check_finite(motion)
        except MessageError as error:
            self._node.counters["motion_not_finite"] += 1
            self._node.log.warning(str(error))
            return
        now_ns = time.monotonic_ns()
        boot, hit = self._node.bus.boot, self.lease.hit
        self.lease, order, refusal = lease.on_motion(
            self.lease, motion, now_ns, self._lease_ns, boot
        )
        if order is not None:
            self._order(order, motion)
            judged = hit is not None and self.lease.hit is None and order is Order.BRAKE
            self._time(arrival, judged)
        self._report(refusal, motion)

    def _time(self, arrival: Arrival[Motion], judged: bool) -> None:
        motion, sent_ns = arrival.message, time.monotonic_ns()
        shared = self._node.bus.shares_clock(motion)
        self._timings.on_motion(motion, shared, arrival.received_ns, sent_ns)
        if judged:
            self._timings.on_judged(motion, shared, arrival.received_ns, sent_ns)

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Take in the measured velocity."""
        self._velocity = velocity, now_ns

    def brake(self) -> int:
        """BREAK at once, for a hit that ``on_hit`` takes in next; return when it was sent."""
        self._sockets.send(self._brake, self.port)
        return time.monotonic_ns()

    def on_hit(self, seq: int, now_ns: int, receipt: Receipt, braked_ns: int | None = None) -> None:
        """Take in a hit, in the sample that will be published as ``seq``: BREAK, and stay so."""
        self.lease, order = lease.on_hit(self.lease, seq, now_ns)
        if braked_ns is None:
            self._order(order)
            braked_ns = time.monotonic_ns()
        self._timings.on_reflex(seq, receipt, braked_ns)

    def on_ready(self, ready: bool) -> None:
        """Take in whether the board may be driven."""
        self.lease = lease.on_ready(self.lease, ready and self._stopping_ns is None)

    def on_tick(self, now_ns: int) -> None:
        """Send what is due although nobody asked."""
        self.lease, order = lease.on_tick(
            self.lease, now_ns, self._lease_ns, self._coast_ns, self._standing(now_ns)
        )
        if order is not None:
            self._order(order)

    def at_rest(self) -> bool:
        """Stop the vehicle for good; true once it stands, or a second has passed."""
        now_ns = time.monotonic_ns()
        if self._stopping_ns is None:
            self._stopping_ns = now_ns
            self.on_ready(False)
            self._order(Order.STOP)
        return self._rests() or now_ns - self._stopping_ns > REST_NS

    def last_words(self) -> None:
        """Leave no RUN behind, whatever ends the bridge; the board stops nothing by itself."""
        self._order(Order.STOP if self._rests() else Order.BRAKE)

    def _rests(self) -> bool:
        """Tell whether the vehicle was seen to stand since the bridge began to stop."""
        measured_ns = self._velocity[1] if self._velocity else 0
        stopped = self._stopping_ns is not None and measured_ns > self._stopping_ns
        return stopped and self._standing(time.monotonic_ns())

    def send(self, frame: Frame) -> None:
        """Send any frame to the board."""
        self._sockets.send(self._framing.pack(frame), self.port)

    def _order(self, order: Order, motion: Motion | None = None) -> None:
        self.send(self._translator.command(order, motion))

    def _standing(self, now_ns: int) -> bool:
        """Judge by the measured velocity; one that has dried up tells nothing any more.

        One never heard of counts as standing: this bridge has moved nothing yet.
        """
        if self._velocity is None:
            return True
        velocity, measured_ns = self._velocity
        heard = now_ns - measured_ns <= self._silence_ns
        return heard and lease.standing(velocity.linear, velocity.angular)

    def _report(self, refusal: Refusal | None, motion: Motion) -> None:
        if refusal is not None:
            self._node.counters[f"motion_{refusal}"] += 1
        news = motion.boot not in self._rivals and len(self._rivals) < RIVALS_MAX
        if refusal is Refusal.SECOND_AUTHORITY and news:
            self._rivals.add(motion.boot)
            text = "a second sender on @cmd/motion is refused"
            self._node.event("second_authority", "error", text, boot=motion.boot)
