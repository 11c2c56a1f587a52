"""Speed limits of third parties, and emergency stops that must be kept alive.

Third parties are a lidar, a person detector, or a fleet manager. The newest limit of
a source holds for its lease. A cap scales the requested twist as a whole, which keeps its curve; it
never raises a speed. A cap of zero is a protective stop (``limit_stop``). It ends by itself, and
the source of motion then needs a neutral request: the third party sees what safety does not, so
only a new request of an operator or a program may start the vehicle, never a stick that is still
pushed. The silence of a source is a setting: ``stop`` stops the vehicle (``limit_silent``) from the
start of safety until the first limit, and after each lease; ``ignore`` has no effect. Two
publishers on one source stop the vehicle (``two_publishers``), for the lease of the source and
0.5 s at least: nobody knows which of both is right, and the other one may be slow.

**Keepalives** of emergency stops, as a pendant with a radio link, are sources whose silence is
``latch``; a limit without a cap is a sign of life. Before the first one the cause ``starting``
inhibits. From then on silence latches ``estop_keepalive`` and brakes. Its time counts from when
safety sent the heartbeat that a message echoes, not from the reception: a message that a proxy held
for 3 s proves nothing about now. A name belongs to one running program. A message of another one,
or one after a gap, shows that the first program ended or that two operators rely on one name: it
latches too.
"""

import math
from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from common.motion import ROUNDED_MPS, ROUNDED_RADPS, STILL, Twist
from common.text import printable
from services.safety.config import LimitSource
from services.safety.core.causes import Observation
from services.safety.core.channel import Admission, Channel
from services.safety.core.inputs import LimitRequest
from t2.messages import MAX_REASON, LimitEffect, LimitState, Phrase


class LimitChannel(Channel, frozen=True, kw_only=True):
    """State of one source, with its newest limit; infinite: no cap."""

    linear: float = math.inf  # m/s
    angular: float = math.inf  # rad/s
    reason: str = ""

    @property
    def stops(self) -> bool:
        """Whether it is a protective stop: a cap of zero, as a motion frame resolves it."""
        return self.linear <= ROUNDED_MPS or self.angular <= ROUNDED_RADPS

    @property
    def because(self) -> str:
        """The reason as the end of a text; empty without one."""
        return f": {self.reason.rstrip('.')}" if self.reason else ""

    def limited(self, twist: Twist) -> Twist:
        """Return the twist slowed on the same curve."""
        return STILL if self.stops else twist.within(self.linear, self.angular)


class SpeedLimits(Struct, frozen=True):
    """State of all limit sources in the settings."""

    sources: Mapping[str, LimitSource]
    channels: Mapping[str, LimitChannel] = {}

    def accept(self, request: LimitRequest, admission: Admission) -> tuple["SpeedLimits", str]:
        """Check a limit; return the reason of its refusal, empty when accepted."""
        name, limit = request.source, request.message
        refused = admission.refusal(name, self.sources, limit)
        if refused or limit is None:
            return self, refused
        before, source = self.channels.get(name, LimitChannel()), self.sources[name]
        now_ns, lease_s = request.received_ns, source.lease
        channel, refused = before.accept(limit, now_ns, lease_s, admission.max_age_ns)
        if not refused:
            channel = replace(
                channel,
                linear=_cap(limit.linear),
                angular=_cap(limit.angular),
                reason=printable(limit.reason)[:MAX_REASON],
            )
            if source.latches:
                if before.boot is not None and not before.is_fresh(now_ns, lease_s):
                    channel = replace(channel, conflict_ns=now_ns)
                channel = replace(channel, lease_ns=admission.sent_ns(limit))
        return replace(self, channels={**self.channels, name: channel}), refused

    def limited(self, twist: Twist, now_ns: int) -> tuple[Twist, str | None]:
        """Return the twist within all caps, and the source of the tightest one that slows it."""
        tightest = None
        for name, channel in self._valid(now_ns):
            slower = channel.limited(twist)
            if slower != twist:
                twist, tightest = slower, name
        return twist, tightest

    def observations(self, now_ns: int) -> Iterator[Observation]:
        """Yield the causes that forbid motion."""
        stopping = [f"{name}{one.because}" for name, one in self._valid(now_ns) if one.stops]
        if stopping:
            by = Phrase("limit_stop.by", {"sources": tuple(stopping)})
            yield Observation("limit_stop", (by,))
        if silent := self._silent(now_ns):
            of = Phrase("limit_silent.of", {"sources": tuple(silent)})
            yield Observation("limit_silent", (of,))
        if lost := self._lost(now_ns):
            kept = Phrase("estop_keepalive.lost", {"names": tuple(lost)})
            yield Observation("estop_keepalive", (kept,))

    @property
    def missing(self) -> list[str]:
        """The names of emergency stops that were not kept alive since the start."""
        return [n for n, one in self.sources.items() if one.latches and n not in self.channels]

    def conflicts(self, now_ns: int) -> list[str]:
        """Return the names of sources with two publishers."""
        return [f"limit {name}" for name in self._in_conflict(now_ns)]

    def states(self, slowing: str | None, now_ns: int) -> tuple[LimitState, ...]:
        """Return the published states; ``slowing`` is the source that slows the vehicle."""
        if not self.sources:
            return ()
        valid = dict(self._valid(now_ns))
        lost = self._lost(now_ns)
        effects: dict[str | None, LimitEffect] = {slowing: "slow"}
        effects |= dict.fromkeys((name for name, one in valid.items() if one.stops), "stop")
        effects |= dict.fromkeys((*self._silent(now_ns), *self.missing), "stop")
        effects |= dict.fromkeys(lost, "brake")  # the worst one last
        return tuple(
            LimitState(
                source=name,
                linear=_published(valid[name].linear) if name in valid else None,
                angular=_published(valid[name].angular) if name in valid else None,
                reason=valid[name].reason if name in valid else "",
                age=self.channels.get(name, LimitChannel()).age_s(now_ns),
                lease=source.lease,
                silence=source.silence,
                silent=name not in valid or name in lost,
                effect=effects.get(name, "none"),
            )
            for name, source in self.sources.items()
        )

    def _valid(self, now_ns: int) -> Iterator[tuple[str, LimitChannel]]:
        """Yield the sources whose lease lives."""
        for name, one in self.channels.items():
            if one.is_fresh(now_ns, self.sources[name].lease):
                yield name, one

    def _in_conflict(self, now_ns: int) -> list[str]:
        """Return the sources with two publishers within a lease: the other one may be slow."""
        return [
            name
            for name, one in self.channels.items()
            if one.in_conflict(now_ns, self.sources[name].lease) and not self.sources[name].latches
        ]

    def _lost(self, now_ns: int) -> list[str]:
        """Return the emergency stops that were kept alive and are not, or by two programs."""
        return [
            name
            for name, one in self.channels.items()
            if self.sources[name].latches
            and (not one.is_fresh(now_ns, self.sources[name].lease) or one.in_conflict(now_ns))
        ]

    def _silent(self, now_ns: int) -> list[str]:
        """Return the sources whose silence stops the vehicle, and that are silent."""
        valid = dict(self._valid(now_ns))
        return [
            name
            for name, source in self.sources.items()
            if source.silence == "stop" and name not in valid
        ]


def _cap(value: float | None) -> float:
    return math.inf if value is None else value


def _published(cap: float) -> float | None:
    return None if cap == math.inf else cap
