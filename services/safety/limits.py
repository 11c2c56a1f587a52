"""Speed limits by third parties: a lidar, a person detector, a fleet manager.

A source limits on ``@cmd/limit/{source}``. Its newest limit holds for the lease of the source. A
cap scales the requested twist as a whole, which keeps its curve; it never raises a speed. A cap of
zero is a protective stop (``limit_stop``). It ends by itself, and the source of motion then needs a
neutral request: the third party sees what safety does not, so only a new request of an operator or
a program may start the vehicle, never a stick that is still pushed.

The silence of a source is a setting: ``stop`` stops the vehicle (``limit_silent``) from the start
of safety until the first limit, and after each lease; ``ignore`` has no effect. Two publishers on
one source stop the vehicle (``two_publishers`` and ``limit_stop``), for the lease of the source and
0.5 s at least: nobody knows which of both is right, and the other one may be slow. The source of
motion then needs a neutral request. The reasons of refusals are those of ``channel.py``.
"""

import math
from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from common.messages import LimitState
from common.motion import ROUNDED_MPS, ROUNDED_RADPS, STILL, Twist
from services.safety.channel import Admission, Channel
from services.safety.config import LimitSource
from services.safety.inputs import LimitRequest
from services.safety.latches import Observation


class LimitChannel(Channel, frozen=True, kw_only=True):
    """State of one source, with its newest limit; infinite: no cap."""

    linear: float = math.inf  # m/s
    angular: float = math.inf  # rad/s
    reason: str = ""

    @property
    def stops(self) -> bool:
        """Whether it is a protective stop: a cap of zero, as a motion frame resolves it."""
        return self.linear <= ROUNDED_MPS or self.angular <= ROUNDED_RADPS

    def limited(self, twist: Twist) -> Twist:
        """Return the twist slowed on the same curve."""
        return STILL if self.stops else twist.within(self.linear, self.angular)


class SpeedLimits(Struct, frozen=True):
    """State of all limit sources in the settings."""

    sources: Mapping[str, LimitSource]
    channels: Mapping[str, LimitChannel] = {}

    def accept(self, request: LimitRequest, admission: Admission) -> tuple["SpeedLimits", str]:
        """Check a limit; return the reason of its refusal, empty when accepted."""
        name, limit = request.source, request.limit
        caps = (limit.linear, limit.angular) if limit else ()
        refused = admission.refusal(
            name, self.sources, limit, *(cap for cap in caps if cap is not None)
        )
        if refused or limit is None:
            return self, refused
        before, lease_s = self.channels.get(name, LimitChannel()), self.sources[name].lease
        channel, refused = before.accept(limit, request.received_ns, lease_s, admission.max_age_ns)
        if not refused:
            channel = replace(
                channel,
                linear=_cap(limit.linear),
                angular=_cap(limit.angular),
                reason=printable(limit.reason),
            )
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
        """Yield the causes that forbid motion, present or not; none without sources."""
        if not self.sources:
            return
        tick = (0, now_ns)
        stopping = [f"{name}{_because(one)}" for name, one in self._valid(now_ns) if one.stops]
        stopping += [f"{name}: two publishers" for name in self._in_conflict(now_ns)]
        silent = ", ".join(self._silent(now_ns))
        silent_text = f"No speed limit arrives of {silent}."
        yield Observation("limit_stop", bool(stopping), tick, f"Stopped by {', '.join(stopping)}.")
        yield Observation("limit_silent", bool(silent), tick, silent_text)

    def slowed_text(self, source: str | None) -> str:
        """Return the text of a source that slows the vehicle."""
        return f"Slowed by {source}{_because(self.channels[source])}." if source else ""

    def conflicts(self, now_ns: int) -> list[str]:
        """Return the names of sources with two publishers."""
        return [f"limit {name}" for name in self._in_conflict(now_ns)]

    def states(self, slowing: str | None, now_ns: int) -> tuple[LimitState, ...]:
        """Return the published states; ``slowing`` is the source that slows the vehicle."""
        if not self.sources:
            return ()
        valid = dict(self._valid(now_ns))
        stopping = {name for name, one in valid.items() if one.stops}.union(self._silent(now_ns))
        return tuple(
            LimitState(
                source=name,
                linear=_published(valid[name].linear) if name in valid else None,
                angular=_published(valid[name].angular) if name in valid else None,
                reason=valid[name].reason if name in valid else "",
                age=self.channels.get(name, LimitChannel()).age_s(now_ns),
                silent=name not in valid,
                effect="stop" if name in stopping else "slow" if name == slowing else "none",
            )
            for name in self.sources
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
            if one.in_conflict(now_ns, self.sources[name].lease)
        ]

    def _silent(self, now_ns: int) -> list[str]:
        """Return the sources whose silence stops the vehicle, and that are silent."""
        valid = dict(self._valid(now_ns))
        return [
            name
            for name, source in self.sources.items()
            if source.silence == "stop" and name not in valid
        ]


def printable(text: str) -> str:
    """Return the text without control and formatting characters, which could forge a screen."""
    return " ".join("".join(one if one.isprintable() else " " for one in text).split())


def _because(limit: LimitChannel) -> str:
    return f": {limit.reason.rstrip('.')}" if limit.reason else ""


def _cap(value: float | None) -> float:
    return math.inf if value is None else value


def _published(cap: float) -> float | None:
    return None if cap == math.inf else cap
