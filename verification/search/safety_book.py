"""Oracle's book on one safety service: messages delivered to it, and the motion they permit.

Nothing here comes from the code under test: times, limits and geometry are those of the safety case
(``docs/safety.md``), repeated here on purpose.
"""

import math
from collections import Counter, deque
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from t2 import messages as m
from verification.search.condition_books import (
    BRAKING_MPS2,
    BRAKING_RADPS2,
    PENDANT,
    Channel,
    KeepaliveBook,
    LimitBook,
    StandstillBook,
    channels,
    rolls,
)
from verification.search.operator_book import OperatorBook, direction_of

LEASES_S = {
    "teleop": 0.3, "checkout": 0.3, "web": 0.3, "demo": 0.3, "ros2": 0.3, "nav": 0.2, "patrol": 0.3
}  # fmt: skip
PRIORITIES = {
    "teleop": 30, "checkout": 25, "web": 20, "demo": 15, "ros2": 11, "nav": 10, "patrol": 5
}  # fmt: skip
AGES_S = {"velocity": 0.2, "bumper": 0.07, "link": 0.6, "switches": 3.0, "left": 2.0, "right": 2.0}
GOOD_SAMPLES, SETTLE_S = 3, 0.5
LAPSE_S = 1.0  # after its lease a source is as new
MARGIN_M, REACT_S, RANGES_AGE_S = 0.20, 0.27, 0.3
# After a zero when a fault had been shown for so long, an operator may creep toward that sonar.
OPERATORS, BLIND_MPS, SHOWN_S = ("teleop", "checkout", "web"), 0.15, 1.0
MOST_MPS, MOST_RADPS = 1.0, 1.0
RAMP_S = 2.5  # from the highest speed to standstill, and some
FAST_MPS, FAST_S = 1.35, 0.4  # measured: no command allows it, so it is a runaway
STEPS = 20  # of a stop whose axes end at different times
STEP_S = 0.03  # decisions are that far apart at most, while nothing stalled
ROUNDING = 2e-3

FRONT, LEFT = 0.55, 0.35  # m from the middle to the bumpers
# Place and direction of each sonar, clockwise from the left (manual 2.3).
SONARS = (
    (0.0, LEFT, 90), (FRONT, LEFT, 45), (FRONT, 0.0, 0), (FRONT, -LEFT, -45),
    (0.0, -LEFT, -90), (-FRONT, -LEFT, -135), (-FRONT, 0.0, 180), (-FRONT, LEFT, 135),
)  # fmt: skip
FLANKS = (0, 4)


@dataclass(slots=True)
class SafetyBook:
    """Messages delivered to one safety service, by the time of delivery."""

    boot: int
    recess: float = 0.0  # m that each sonar is deep in the hull
    turn_braking: float = BRAKING_RADPS2  # rad/s^2, guaranteed
    samples: dict[str, tuple[int, m.Message]] = field(default_factory=dict)
    ranges: deque[tuple[int, m.Ultrasonic]] = field(default_factory=lambda: deque(maxlen=3))
    bumpers: deque[m.Bumper] = field(default_factory=lambda: deque(maxlen=3))
    requests: dict[str, Channel] = field(default_factory=lambda: channels(LEASES_S))
    still_ns: dict[str, int] = field(default_factory=dict)  # source: since when it asks for none
    zeros: dict[str, int] = field(default_factory=dict)  # source: its last request of zero
    unseen: dict[int, int] = field(default_factory=dict)  # sonar: since when it shows nothing
    operators: OperatorBook = field(default_factory=OperatorBook)
    bad_ns: int = 0  # when inputs were last seen to be bad
    neutral: dict[str, int] = field(default_factory=dict)  # source: when it asked for zero
    barred_ns: int = 0  # when anything last wanted a neutral request
    better_ns: dict[str, int] = field(default_factory=dict)  # source: when it was last overruled
    let_go: set[str] = field(default_factory=set)  # sources whose next release may begin
    stood_ns: int = 0  # when the newest two velocities were those of a standstill
    fast_ns: int | None = None  # since when the vehicle is measured to be too fast
    estop_session_was_up: bool = False
    decided_ns: int | None = None
    standstill: StandstillBook = field(default_factory=StandstillBook)
    keepalive: KeepaliveBook = field(default_factory=KeepaliveBook)
    limits: LimitBook = field(default_factory=LimitBook)
    well: Counter[str] = field(default_factory=Counter)  # samples without a fault, by driver

    def on_source(self, name: str, message: m.SourceMessage, now_ns: int) -> bool:
        """Take a message of a source in; return whether an emergency stop was lost."""
        sent_ns = self.operators.beats.get(message.echo)
        if isinstance(message, m.Drive) and name in self.requests:
            self._on_drive(name, message, sent_ns, now_ns)
        elif isinstance(message, m.Limit) and name in self.limits.sources:
            self.limits.sources[name].take(message, sent_ns, now_ns)
        pendant = isinstance(message, m.Limit) and name == PENDANT
        return pendant and self.keepalive.on_message(message, sent_ns, now_ns)

    def _on_drive(self, source: str, drive: m.Drive, sent_ns: int | None, now_ns: int) -> None:
        channel = self.requests[source]
        over_ns = channel.at_ns + round(channel.lease_s * NS_PER_S)
        rested = now_ns > over_ns and self.stood_ns > over_ns + STEP_S * NS_PER_S
        lapsed = rested or now_ns > over_ns + LAPSE_S * NS_PER_S
        before, was_fresh = channel.message, channel.is_fresh(now_ns)
        if not channel.take(drive, sent_ns, now_ns):
            return
        if lapsed:
            self.neutral.pop(source, None)  # it does not drive on by itself
        if lapsed or (before and before.boot != drive.boot):
            self.let_go.discard(source)
        if channel.is_neutral:
            self.zeros[source] = now_ns
            self.let_go.add(source)
            due_ns = max(self.barred_ns, self.better_ns.get(source, 0))
            if now_ns > due_ns and not self._better(source, now_ns):
                self.neutral[source] = now_ns
        if not was_fresh:
            self.still_ns.pop(source, None)  # it may take over from one that drives
        if channel.is_still:
            self.still_ns.setdefault(source, now_ns)
        else:
            self.still_ns.pop(source, None)

    def on_sample(self, name: str, message: m.Message, now_ns: int) -> None:
        """Take a sample in."""
        if isinstance(message, m.Bumper):
            self._on_bumper(message, now_ns)
        if isinstance(message, m.Velocity):
            _, before = self.samples.get("velocity", (0, None))
            if isinstance(before, m.Velocity) and not rolls(before) and not rolls(message):
                self.stood_ns = now_ns
            too_fast = abs(message.linear) > FAST_MPS
            self.fast_ns = (self.fast_ns or now_ns) if too_fast else None
            self.standstill.on_velocity(message, now_ns)
        if isinstance(message, m.Driver):
            self._on_driver(name, message)
        if isinstance(message, m.Ultrasonic):
            silent_ns = self._silent_since(now_ns)
            self.ranges.append((now_ns, message))
            self._note_unseen(message, silent_ns, now_ns)
        self.samples[name] = now_ns, message

    def _silent_since(self, now_ns: int) -> int | None:
        """Return since when all sonars are silent, None while they are not."""
        last_ns = self.ranges[-1][0] if self.ranges else 0
        over_ns = last_ns + round(RANGES_AGE_S * NS_PER_S)
        return over_ns if now_ns > over_ns else None

    def _note_unseen(self, message: m.Ultrasonic, silent_ns: int | None, now_ns: int) -> None:
        for sonar in range(len(SONARS)):
            if silent_ns is not None or message.status[sonar] == "fault":
                self.unseen.setdefault(sonar, silent_ns or now_ns)
            elif not any(one.status[sonar] == "fault" for _, one in self.ranges):
                self.unseen.pop(sonar, None)

    def _may_creep(self, sonar: int, source: str | None, now_ns: int) -> bool:
        """Return whether an operator has acknowledged the fault of this sonar."""
        since_ns = self.unseen.get(sonar)
        if source not in OPERATORS or since_ns is None or self._silent_since(now_ns) is not None:
            return False
        return self.zeros.get(source, 0) - since_ns >= (SHOWN_S - STEP_S) * NS_PER_S

    def _on_driver(self, side: str, message: m.Driver) -> None:
        _, before = self.samples.get(side, (0, None))
        if message.bits:
            self.well[side] = 0
        elif before is None:
            self.well[side] = GOOD_SAMPLES  # there never was a fault
        elif (before.boot, before.seq) != (message.boot, message.seq):
            self.well[side] += 1

    def _on_bumper(self, message: m.Bumper, now_ns: int) -> None:
        before = self.bumpers[-1] if self.bumpers else message
        if before.boot != message.boot:
            self.bad_ns = self.barred_ns = now_ns
            self.neutral.clear()
        is_new = before.seq != message.seq or not self.bumpers or before.boot != message.boot
        if self.operators.on_bumper(message, is_new, now_ns):
            self.let_go.clear()
        if is_new:
            self.bumpers.append(message)

    def look(self, now_ns: int, reader: bool, tripped: Collection[str]) -> None:
        """Note, at the time of a decision, whether anything wants a neutral request."""
        self.limits.look(now_ns)
        barred = any(self.limits.stops(now_ns)) or any(self.keepalive.missing())
        if "old velocity" in self._what_is_bad(now_ns):
            self.fast_ns = None  # what is not measured is no runaway
        if self._what_is_bad(now_ns) or not reader:
            self.bad_ns = now_ns
        barred = barred or now_ns - self.bad_ns < (SETTLE_S - STEP_S) * NS_PER_S
        if barred or set(tripped) - {"contact"}:  # a key that is held meanwhile
            self.let_go -= {name for name, one in self.requests.items() if one.release != "none"}
        self.let_go -= {source for source in self.let_go if self._better(source, now_ns)}
        for source in filter(lambda one: self._better(one, now_ns), self.requests):
            self.better_ns[source] = now_ns
            self.neutral.pop(source, None)
        if barred or tripped:
            self.barred_ns = now_ns
            self.neutral.clear()

    def _better(self, source: str, now_ns: int) -> list[str]:
        """Return the sources above this one that hold the wheel."""
        higher = (one for one in self.requests if PRIORITIES[one] > PRIORITIES[source])
        return [one for one in higher if self.requests[one].is_fresh(now_ns)]

    def complaints(self, motion: m.Motion, now_ns: int) -> Iterator[str]:
        """Yield the reasons why a motion must not run, except trips."""
        yield from (f"bad input: {bad}" for bad in self._what_is_bad(now_ns))
        if now_ns - self.bad_ns < (SETTLE_S - STEP_S) * NS_PER_S:
            yield "inputs have not settled"
        if abs(motion.linear) > MOST_MPS + ROUNDING or abs(motion.angular) > MOST_RADPS + ROUNDING:
            yield f"beyond the limits: {motion.linear} m/s, {motion.angular} rad/s"
        yield from self._of_source(motion.source or "", self.creeps(motion), now_ns)
        if self.creeps(motion):
            yield from self._of_release(motion)
        yield from self._of_zones(motion, now_ns)
        yield from self.limits.complaints(motion, now_ns)
        yield from self.keepalive.missing()

    def may_reset(self, now_ns: int) -> bool:
        """Return whether a reset may be granted: at standstill, without a drive request."""
        at_ns, velocity = self.samples.get("velocity", (0, None))
        fresh = now_ns - at_ns <= AGES_S["velocity"] * NS_PER_S
        stands = fresh and isinstance(velocity, m.Velocity) and abs(velocity.linear) < 0.02
        asked = any(one.is_fresh(now_ns) and not one.is_neutral for one in self.requests.values())
        return stands and not asked

    def is_gone(self, trip: str) -> bool:
        """Return whether the cause of a trip is gone, so that a reset may clear it."""
        if trip == "contact":
            return len(self.bumpers) == 3 and not any(one.pressed for one in self.bumpers)
        if trip == "driver":
            return all(self.well[side] >= GOOD_SAMPLES for side in ("left", "right"))
        return True

    def _faulty(self) -> Iterator[str]:
        for side in ("left", "right"):
            at = self.samples.get(side)
            if at is not None and isinstance(at[1], m.Driver) and at[1].bits:
                yield side

    def _what_is_bad(self, now_ns: int) -> list[str]:
        bad = list(self._faulty())
        for name, age_s in AGES_S.items():
            if name not in self.samples:
                bad.append(f"no {name}")
            elif now_ns - self.samples[name][0] > age_s * NS_PER_S:
                bad.append(f"old {name}")
        for _, message in self.samples.values():
            if isinstance(message, m.Link) and (message.state != "up" or not message.armed):
                bad.append(f"link {message.state}, armed {message.armed}")
            if isinstance(message, m.Switches) and not (
                message.ultrasonic_brake is True and message.bumper_brake is True
            ):
                bad.append("the board's brakes are not both on")
        return bad

    def creeps(self, motion: m.Motion) -> bool:
        """Return whether a motion is a release: asked for, and the bumper is pressed."""
        request = self.requests.get(motion.source or "")
        pressed = bool(self.bumpers) and self.bumpers[-1].pressed
        return motion.command == "run" and pressed and bool(request and request.release != "none")

    def _of_source(self, source: str, creeps: bool, now_ns: int) -> Iterator[str]:
        if source not in self.requests or not self.requests[source].is_fresh(now_ns):
            yield f"no fresh request of {source!r}"
            return
        if not creeps and now_ns - self.still_ns.get(source, now_ns) > RAMP_S * NS_PER_S:
            yield "no source requests motion"
        if better := self._better(source, now_ns):
            yield f"{better} go before {source}"
        if source not in (self.let_go if creeps else self.neutral):
            yield f"{source} was not neutral since the last cause"
        if self.requests[source].has_rival(now_ns):
            yield "two publishers on one source"

    def _of_release(self, motion: m.Motion) -> Iterator[str]:
        yield from self.operators.complaints(motion)
        if motion.source not in OPERATORS:
            yield f"{motion.source} is no operator's source and releases"
        if direction_of(motion) != self.requests[motion.source or ""].release:
            yield "a release the other way than the operator chose"

    def _of_zones(self, motion: m.Motion, now_ns: int) -> Iterator[str]:
        measured = self.samples.get("velocity")
        for sonar in range(len(SONARS)):
            room = max(0.0, self._distance(sonar, now_ns) - self.recess - MARGIN_M)
            if not self.creeps(motion) and self._may_creep(sonar, motion.source, now_ns):
                room = max(room, BLIND_MPS * (REACT_S + BLIND_MPS / BRAKING_MPS2 / 2))
            speed, way = self._stopping(sonar, motion)
            if max(speed, way) > ROUNDING and speed * REACT_S + way > room + ROUNDING:
                yield f"{speed:.3f} m/s toward sonar {sonar} with {room:.3f} m of room"
            if measured is not None and isinstance(measured[1], m.Velocity):
                real, way = self._stopping(sonar, measured[1])
                real -= ROUNDING
                share = max(0.0, real - 0.2) / real if real > 0 else 0.0
                needed = share * real * REACT_S + share * share * way
                if needed > room or (room == 0 and real > 0.05):
                    yield f"really {real:.3f} m/s toward sonar {sonar} with {room:.3f} m of room"

    def _stopping(self, sonar: int, twist: m.Motion | m.Velocity) -> tuple[float, float]:
        """Return the speed toward what a sonar sees, and the way of stopping (m/s, m).

        The farther one of a stop on the curve, and of one in which each axis stops by itself.
        """
        driving, turning = approaches(sonar, twist.linear, twist.angular)
        times = abs(twist.linear) / BRAKING_MPS2, abs(twist.angular) / self.turn_braking
        together = (driving + turning) * max(times) / 2
        return max(0.0, driving + turning), max(0.0, together, farthest(driving, turning, times))

    def _distance(self, sonar: int, now_ns: int) -> float:
        """Return what may be believed: the nearest of the last three samples, in metres."""
        if len(self.ranges) < 3 or now_ns - self.ranges[-1][0] > RANGES_AGE_S * NS_PER_S:
            return 0.0
        return min(shown(message, sonar) for _, message in self.ranges)


def farthest(driving: float, turning: float, times: tuple[float, float]) -> float:
    """Return the farthest way (m) of two speeds that fall to zero in these times."""
    way, best, end_s = 0.0, 0.0, max(times)
    for step in range(STEPS if driving * turning < 0 else 0):
        now_s = end_s * (step + 0.5) / STEPS
        left = [max(0.0, 1 - now_s / one) if one else 0.0 for one in times]
        way += (driving * left[0] + turning * left[1]) * end_s / STEPS
        best = max(best, way)
    return best


def shown(message: m.Ultrasonic, sonar: int) -> float:
    """Return what one sample shows, 0 where nothing can be trusted."""
    reading = message.ranges[sonar]
    if message.status[sonar] == "no_echo":
        return math.inf
    return reading if message.status[sonar] == "ok" and reading is not None else 0.0


def approaches(sonar: int, linear: float, angular: float) -> tuple[float, float]:
    """Return how fast (m/s) driving and turning close in on what a sonar sees."""
    x, y, degrees = SONARS[sonar]
    yaw = math.radians(degrees)
    turning = angular * (x * math.sin(yaw) - y * math.cos(yaw))
    return linear * math.cos(yaw), abs(angular) * FRONT if sonar in FLANKS else turning
