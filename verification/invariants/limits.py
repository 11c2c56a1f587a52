"""A source of speed limits, and the oracle's book on the limits delivered to one safety service.

Nothing in the book comes from the code under test.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec

from common import keys
from common import messages as m
from common.freshness import NS_PER_S
from verification.invariants.net import Envelope
from verification.invariants.process import ROBOT, Process

LEASE_S, ECHO_AGE_S, RIVAL_S = 0.5, 0.4, 0.5
NEEDED, IGNORED = "lidar", "fleet"  # whose silence stops; whose silence has no effect
SLOWING = (0.6, 1.0)  # m/s^2, rad/s^2
STEP_S = 0.1  # a decision after a longer pause slows as if it came after this one
ROUNDING = 2e-3
NO_CAP = (math.inf, math.inf)


class Limiter:
    """A source that publishes its caps while ``caps`` is set."""

    def __init__(self, name: str, process: Process) -> None:
        self.name = name
        self.process = process
        self.caps: tuple[float | None, float | None] | None = None
        self.echo = 0
        self.seq = 0
        process.subscribe(keys.SAFETY, self._listen)

    def _listen(self, arrival: Any) -> None:
        self.echo = arrival.message.heartbeat

    def publish(self) -> None:
        """Publish one limit if one is set."""
        if self.caps is not None:
            linear, angular = self.caps
            self.put(m.Limit(linear=linear, angular=angular, echo=self.echo))

    def put(self, limit: m.Limit) -> None:
        """Put any limit, with the next number."""
        self.seq += 1
        process = self.process
        limit = msgspec.structs.replace(limit, boot=limit.boot or process.boot, seq=self.seq)
        key = keys.LIMIT.on(ROBOT, source=self.name)
        process.send(Envelope(key, limit, process.boot, process.net.now_ns))


@dataclass(slots=True)
class GoodLimit:
    """The newest good limit of one source."""

    boot: int
    seq: int
    at_ns: int
    caps: tuple[float, float]  # m/s, rad/s


@dataclass(slots=True)
class LimitBook:
    """Limits delivered to one safety service, and the speed that they permit."""

    newest: dict[str, GoodLimit] = field(default_factory=dict)
    rivals: dict[str, int] = field(default_factory=dict)
    permitted: tuple[float, float] = NO_CAP  # m/s, rad/s; falls at the normal deceleration
    looked_ns: int = 0

    def on_limit(self, source: str, limit: m.Limit, sent_ns: int | None, now_ns: int) -> None:
        """Take a limit in, if it is a good one."""
        caps = tuple(math.inf if one is None else one for one in (limit.linear, limit.angular))
        late = sent_ns is None or now_ns - sent_ns > ECHO_AGE_S * NS_PER_S
        given = [one for one in (limit.linear, limit.angular) if one is not None]
        if source not in (NEEDED, IGNORED) or late or not all(map(math.isfinite, given)):
            return
        old = self.newest.get(source)
        if old is not None and old.boot != limit.boot and self._is_valid(old, now_ns):
            self.rivals[source] = now_ns
        elif old is None or old.boot != limit.boot or limit.seq > old.seq:
            self.newest[source] = GoodLimit(limit.boot, limit.seq, now_ns, (caps[0], caps[1]))

    def look(self, now_ns: int) -> None:
        """Update the permitted speed, at the time of a decision."""
        step_s = min((now_ns - self.looked_ns) / NS_PER_S, STEP_S)
        self.looked_ns = now_ns
        valid = [one.caps for one in self.newest.values() if self._is_valid(one, now_ns)]
        linear, angular = (
            max(cap, min(permitted, 1.0) - slowing * step_s)
            for cap, permitted, slowing in zip(
                (min((caps[axis] for caps in valid), default=math.inf) for axis in (0, 1)),
                self.permitted,
                SLOWING,
                strict=True,
            )
        )
        self.permitted = linear, angular

    def stops(self, now_ns: int) -> Iterator[str]:
        """Yield why the vehicle must stand, whatever is requested."""
        valid = {name for name, one in self.newest.items() if self._is_valid(one, now_ns)}
        if NEEDED not in valid:
            yield f"no limit of {NEEDED}"
        yield from (f"protective stop of {one}" for one in valid if 0 in self.newest[one].caps)

    def complaints(self, motion: m.Motion, now_ns: int) -> Iterator[str]:
        """Yield the reasons why a motion must not run."""
        yield from self.stops(now_ns)
        linear, angular = self.permitted
        if abs(motion.linear) > linear + ROUNDING or abs(motion.angular) > angular + ROUNDING:
            yield f"faster than a limit: {motion.linear} m/s, {motion.angular} rad/s"
        if any(now_ns - at_ns < RIVAL_S * NS_PER_S for at_ns in self.rivals.values()):
            yield "two publishers of one limit"

    def _is_valid(self, limit: GoodLimit, now_ns: int) -> bool:
        return now_ns - limit.at_ns <= LEASE_S * NS_PER_S
