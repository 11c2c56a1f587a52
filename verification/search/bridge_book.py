"""Oracle's books on one bridge, and on short presses of the bumper.

The first one has the messages delivered to the bridge, and the RUN frames they permit.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from common.wire import reports as r
from common.wire.frame import Frame
from t2.messages import Motion

LEASE_NS, SILENCE_NS = NS_PER_S // 5, NS_PER_S // 5
SLACK_NS = NS_PER_S // 40  # the bridge looks every 10 ms
BEGIN_NS = 3 * NS_PER_S  # that BRAKE of the guard continues without a motion message
CLEAR_SAMPLES = 3
PRESS_NS = NS_PER_S * 60 // 1000  # the shortest press that counts
NOTICE_NS = NS_PER_S * 120 // 1000  # after it: the vehicle is no longer driven


@dataclass(slots=True)
class BridgeBook:
    """Messages delivered to one bridge, by the time of delivery."""

    boot: int
    begun_ns: int = 0
    heard_ns: int | None = None
    ultrasonic: bool | None = None
    bumper: bool | None = None
    authority: int | None = None
    seq: int = 0
    renewed_ns: int = 0
    neutral: bool = False
    # Clear samples in a row, and the time of the newest sample, by port: a board may answer on
    # both, and a copy is no second sample.
    clear: dict[int, tuple[int, int]] = field(default_factory=dict)
    published: int = 0  # bumper samples
    braked: bool = False  # whether the last frame was BRAKE
    brake_due: bool = False  # whether a hit or a stop was delivered, and no BRAKE sent yet

    def on_report(self, frame: Frame, port: int, now_ns: int) -> bool:
        """Record a frame of the board; return whether a hit begins with it."""
        if self.heard_ns is None or now_ns - self.heard_ns > SILENCE_NS + SLACK_NS:
            self.ultrasonic = self.bumper = None
            self.neutral = False
        self.heard_ns = now_ns
        if isinstance(frame, r.UltrasonicBrakeReport):
            self.ultrasonic = frame.on
        elif isinstance(frame, r.BumperBrakeReport):
            self.bumper = frame.on
        elif isinstance(frame, r.BumperReport):
            return self._on_bumper(frame.on, port, now_ns)
        if not (self.ultrasonic and self.bumper):
            self.neutral = False
        return False

    def _on_bumper(self, pressed: bool, port: int, now_ns: int) -> bool:
        count, _ = self.clear.get(port, (0, now_ns))
        if not pressed:
            self.clear[port] = count + 1, now_ns
            return False
        counts = self.clear.values()
        newest = [clear for clear, at_ns in counts if now_ns - at_ns <= SILENCE_NS]
        hit = all(clear >= CLEAR_SAMPLES for clear in newest or [clear for clear, _ in counts])
        self.clear = {each: (0, at_ns) for each, (_, at_ns) in self.clear.items()}
        self.clear[port] = 0, now_ns
        self.brake_due = self.brake_due or hit
        return hit

    def on_motion(self, motion: Motion, now_ns: int) -> bool:
        """Record a motion; return whether it comes from the authority and in order."""
        over = now_ns - self.renewed_ns > LEASE_NS
        if motion.boot != self.authority:
            if self.authority is not None and not over:
                return False
            self.authority, self.seq, self.neutral = motion.boot, motion.seq - 1, False
        if motion.seq <= self.seq:
            return False
        self.seq, self.renewed_ns = motion.seq, now_ns
        if over:
            self.neutral = False
        if motion.command != "run" or motion.linear == 0 == motion.angular:
            self.neutral = self.neutral or self.ready(now_ns)
        return True

    def ready(self, now_ns: int) -> bool:
        """Return whether the board is connected, with both brakes on."""
        connected = self.heard_ns is not None and now_ns - self.heard_ns <= SILENCE_NS + SLACK_NS
        return connected and self.ultrasonic is True and self.bumper is True

    def may_only_brake(self, now_ns: int) -> bool:
        """Return whether the guard's BRAKE must continue: no safety has commanded yet."""
        return self.authority is None and now_ns - self.begun_ns < BEGIN_NS

    def complaints(self, now_ns: int) -> Iterator[str]:
        """Yield the reasons why no RUN may be sent now."""
        if not self.ready(now_ns):
            yield "the board is silent, or its brakes are not both on"
        if not self.neutral:
            yield "no neutral motion came since the bridge began, lost something or changed hands"


@dataclass(slots=True)
class PressBook:
    """The real contact of the strip, whether or not a sample of it reaches a bridge.

    A press while the vehicle is driven must be reported to a bridge, or the vehicle be stopped.
    """

    since_ns: int | None = None  # since when it is closed
    counts: bool = False  # whether it was closed long enough
    noticed: bool = False  # whether it was reported, or another frame than a RUN has left
    driven: bool = False  # whether the newest frame is a RUN that moves
    slack_ns: int = 0  # of cable and stalls

    def on_frame(self, moves: bool) -> None:
        """Record a motion frame that leaves for the board."""
        self.driven = moves
        self.noticed = self.noticed or not moves

    def look(self, closed: bool, now_ns: int) -> bool:
        """Look at the contact; return whether a press was missed."""
        if self.since_ns is None:
            if closed:
                self.since_ns, self.counts, self.noticed = now_ns, False, not self.driven
            return False
        self.counts = self.counts or now_ns - self.since_ns >= PRESS_NS
        if not self.counts and not closed:
            self.since_ns = None
            return False
        over = now_ns - self.since_ns > PRESS_NS + NOTICE_NS + self.slack_ns
        missed = over and not self.noticed
        if (over or self.noticed) and not closed:
            self.since_ns = None
        self.noticed = self.noticed or missed
        return missed
