"""Oracle's books on sources, limits, signs of life and standstill, as one safety service has them.

As in ``safety_book.py``, nothing is taken from the code under test.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from t2.messages import Drive, Limit, Motion, ReleaseRequest, SourceMessage, Velocity

LEASE_S, ECHO_AGE_S, RIVAL_S = 0.5, 0.4, 0.5
NEEDED, IGNORED = "lidar", "detector"  # whose silence stops; whose silence has no effect
SLOWING = (0.6, 1.0)  # m/s^2, rad/s^2
STEP_S = 0.1  # a decision after a longer pause slows as if it came after this one
ROUNDING = 2e-3
NO_CAP = (math.inf, math.inf)

PENDANT, TIMEOUT_S = "pendant", 1.0  # its silence latches

BRAKING_MPS2, BRAKING_RADPS2, GRACE_S = 0.6, 1.0, 0.5
FASTEST_MPS, FASTEST_RADPS = 1.0, 1.0
LONGEST_STOP_S = 3.0
STANDING_MPS, STANDING_RADPS = 0.02, 0.05
AWAY = 0.05  # m or rad that a standing vehicle may be moved
# Two samples and a decision later at 1.5 m/s, and what the oracle counts more generously.
SLACK, SLACK_S = 0.10, 0.06
GAP_S, FRESH_S = 0.1, 0.2


@dataclass(slots=True)
class Channel:
    """The newest good request or limit of one source."""

    lease_s: float
    message: Drive | Limit | None = None
    at_ns: int = 0
    rival_ns: int | None = None  # the last message of a second publisher

    def take(self, message: Drive | Limit, sent_ns: int | None, now_ns: int) -> bool:
        """Take a message in, whose echo was sent then; return whether it is a good one."""
        given = [one for one in (message.linear, message.angular) if one is not None]
        late = sent_ns is None or now_ns - sent_ns > ECHO_AGE_S * NS_PER_S
        if late or not all(map(math.isfinite, given)):
            return False
        if self.message is not None and self.message.boot != message.boot:
            if self.is_fresh(now_ns):
                self.rival_ns = now_ns
                return False
        elif self.message is not None and message.seq <= self.message.seq:
            return False
        self.message, self.at_ns = message, now_ns
        return True

    def is_fresh(self, now_ns: int) -> bool:
        """Return whether the newest message is still valid."""
        return self.message is not None and now_ns - self.at_ns <= self.lease_s * NS_PER_S

    def has_rival(self, now_ns: int) -> bool:
        """Return whether a second publisher was there of late."""
        return self.rival_ns is not None and now_ns - self.rival_ns < RIVAL_S * NS_PER_S

    @property
    def release(self) -> ReleaseRequest:
        """The release that the newest message asks for."""
        return self.message.release if isinstance(self.message, Drive) else "none"

    @property
    def is_still(self) -> bool:
        """Whether the newest message asks for no velocity."""
        message = self.message
        return message is not None and (
            message.linear == 0 == message.angular or self.release != "none"
        )

    @property
    def is_neutral(self) -> bool:
        """Whether the newest message asks for no motion at all."""
        return self.is_still and self.release == "none"


def channels(leases_s: dict[str, float]) -> dict[str, Channel]:
    """Return a channel for each source."""
    return {name: Channel(lease_s) for name, lease_s in leases_s.items()}


@dataclass(slots=True)
class LimitBook:
    """Limits delivered to one safety service, and the speed that they permit."""

    sources: dict[str, Channel] = field(
        default_factory=lambda: channels({NEEDED: LEASE_S, IGNORED: LEASE_S})
    )
    permitted: tuple[float, float] = NO_CAP  # m/s, rad/s; falls at the normal deceleration
    looked_ns: int = 0

    def valid(self, now_ns: int) -> dict[str, tuple[float, float]]:
        """Return the caps of the valid limits, in m/s and rad/s."""
        return {
            name: (_cap(one.message.linear), _cap(one.message.angular))
            for name, one in self.sources.items()
            if one.message is not None and one.is_fresh(now_ns)
        }

    def look(self, now_ns: int) -> None:
        """Update the permitted speed, at the time of a decision."""
        step_s = min((now_ns - self.looked_ns) / NS_PER_S, STEP_S)
        self.looked_ns = now_ns
        valid = self.valid(now_ns).values()
        linear, angular = (
            max(
                min((caps[axis] for caps in valid), default=math.inf),
                min(self.permitted[axis], 1.0) - SLOWING[axis] * step_s,
            )
            for axis in (0, 1)
        )
        self.permitted = linear, angular

    def stops(self, now_ns: int) -> Iterator[str]:
        """Yield why the vehicle must stand, whatever is requested."""
        valid = self.valid(now_ns)
        if NEEDED not in valid:
            yield f"no limit of {NEEDED}"
        yield from (f"protective stop of {name}" for name, caps in valid.items() if 0 in caps)

    def complaints(self, motion: Motion, now_ns: int) -> Iterator[str]:
        """Yield the reasons why a motion must not run."""
        yield from self.stops(now_ns)
        linear, angular = self.permitted
        if abs(motion.linear) > linear + ROUNDING or abs(motion.angular) > angular + ROUNDING:
            yield f"faster than a limit: {motion.linear} m/s, {motion.angular} rad/s"
        if any(one.has_rival(now_ns) for one in self.sources.values()):
            yield "two publishers of one limit"


def _cap(given: float | None) -> float:
    return math.inf if given is None else given


@dataclass(slots=True)
class KeepaliveBook:
    """The newest proof of life of a pendant that one safety service received."""

    boot: int | None = None
    seq: int = 0
    proven_ns: int = 0  # when safety sent the heartbeat that was echoed last

    def on_message(self, message: SourceMessage, sent_ns: int | None, now_ns: int) -> bool:
        """Take a message in; return whether it shows a loss: a gap, or another program."""
        if sent_ns is None or now_ns - sent_ns > TIMEOUT_S * NS_PER_S:
            return False
        lost = self.boot is not None and now_ns - self.proven_ns > TIMEOUT_S * NS_PER_S
        broken = self.boot is not None and (lost or message.boot != self.boot)
        if message.boot != self.boot and (self.boot is None or lost):
            self.boot, self.seq = message.boot, message.seq - 1
        if message.boot == self.boot and message.seq > self.seq:
            self.seq, self.proven_ns = message.seq, sent_ns
        return broken

    def is_lost(self, now_ns: int) -> bool:
        """Return whether it was received once and is not alive now."""
        return self.boot is not None and now_ns - self.proven_ns > TIMEOUT_S * NS_PER_S

    def missing(self) -> Iterator[str]:
        """Yield a complaint while it was never received."""
        if self.boot is None:
            yield "no sign of life of the pendant"


@dataclass(slots=True)
class StandstillBook:
    """The velocities that one safety service received, and when it last commanded motion."""

    stop_ns: int = 0  # when standstill was commanded
    due_ns: int | None = None  # when the vehicle must stand; None while motion is commanded
    newest: Velocity | None = None
    newest_ns: int = 0
    rolled: float = 0.0  # m or rad, the larger, since standstill was last commanded
    turn_braking: float = BRAKING_RADPS2  # rad/s^2, guaranteed

    def on_velocity(self, velocity: Velocity, now_ns: int) -> None:
        """Take a velocity in."""
        if rolls(velocity):
            gap_s = min((now_ns - self.newest_ns) / NS_PER_S, GAP_S)
            before = self.newest is not None and rolls(self.newest)
            self.rolled += max(abs(velocity.linear), abs(velocity.angular)) * gap_s * before
        else:
            self.rolled = 0.0
        if self.due_ns is not None and not self._known(now_ns):  # the first one after a gap
            self.due_ns = min(self.due_ns, now_ns + self._stopping_ns(velocity))
        self.newest, self.newest_ns = velocity, now_ns

    def _known(self, now_ns: int) -> bool:
        """Return whether the velocity is known; an unknown one counts as the highest."""
        return now_ns - self.newest_ns <= FRESH_S * NS_PER_S

    def _stopping_ns(self, velocity: Velocity | None) -> int:
        """Return how long stopping may take from this velocity."""
        linear, angular = (FASTEST_MPS, FASTEST_RADPS)
        if velocity is not None:
            linear, angular = velocity.linear, velocity.angular
        stopping_s = max(abs(linear) / BRAKING_MPS2, abs(angular) / self.turn_braking)
        return round(min(stopping_s + GRACE_S, LONGEST_STOP_S) * NS_PER_S)

    def complaint(self, motion: Motion, moves: bool, now_ns: int) -> str:
        """Return what is wrong with a motion that does not brake; empty if nothing is."""
        if moves:
            self.due_ns, self.rolled = None, 0.0
            return ""
        if self.due_ns is None:
            self.stop_ns = self.due_ns = now_ns
        if now_ns - self.stop_ns <= GAP_S * NS_PER_S:  # the speed at STOP may be measured later
            speed = self.newest if self._known(now_ns) else None
            self.due_ns = max(self.due_ns, self.stop_ns + self._stopping_ns(speed))
        late_s = (now_ns - self.due_ns) / NS_PER_S
        if motion.command == "brake" or late_s < SLACK_S or not self._known(now_ns):
            return ""
        rolled = self.rolled > AWAY + SLACK
        return f"safety: no BRAKE while the vehicle rolls {self.rolled:.2f}" if rolled else ""


def rolls(velocity: Velocity) -> bool:
    """Return whether a velocity is a motion."""
    return abs(velocity.linear) >= STANDING_MPS or abs(velocity.angular) >= STANDING_RADPS
