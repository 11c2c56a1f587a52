"""Sources: which messages of other programs count; drive requests and limits.

**Channel.** Each message carries ``boot`` and ``seq`` of its publisher, and echoes a heartbeat of
safety. A refused message changes nothing except where noted. It is counted by its reason:

================ =============================================================================
unknown_source   the settings contain no such source
not_a_request    payload of the wrong type, NaN or infinity
late             the echo is unknown or too old, see ``common/heartbeat.py``
second_publisher another ``boot`` while the lease of the first one lives; also stops the vehicle
seq_not_rising   a repeated or an older number, until the last message is older than ``max_age_ns``
================ =============================================================================

A lease counts from the reception of a message, so time in the queue is part of it. After
``max_age_ns`` a number that does not rise belongs to a copy of the publisher, such as a fork or a
restored snapshot: all earlier messages echo a heartbeat that is too old by then.

**Arbiter.** The fresh source of the highest priority is in control. A source is fresh while its
last request is younger than its lease; it gives up control by silence. A source may move the
vehicle only after a *neutral* request (zero): after its own start, after every cause that requires
it, after a source of higher priority was in control, when its lease was over while the vehicle
stood, and when its lease has been over for ``LAPSE_S``.

**Speed limits** by third parties: a lidar, a person detector, a fleet manager. The newest limit of
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
from collections.abc import Container, Iterator, Mapping
from typing import TypeVar

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from common.motion import ROUNDED_MPS, ROUNDED_RADPS, STILL, Twist
from common.text import printable
from services.safety.config import LimitSource, Source
from services.safety.core.causes import Observation
from services.safety.core.inputs import DriveRequest, LimitRequest
from t2.messages import (
    MAX_REASON,
    Drive,
    LimitState,
    Phrase,
    ReleaseRequest,
    SourceMessage,
)

C = TypeVar("C", bound="Channel")

CONFLICT_NS = NS_PER_S // 2  # one publisher must remain alone for this long


class Channel(Struct, frozen=True, kw_only=True):
    """State of one source."""

    boot: int | None = None
    seq: int = 0
    received_ns: int | None = None  # of the last accepted message
    conflict_ns: int | None = None  # when a second publisher last sent a message

    def is_fresh(self, now_ns: int, lease_s: float) -> bool:
        """Return whether the lease of the last message still lives."""
        return self.received_ns is not None and now_ns - self.received_ns <= lease_s * NS_PER_S

    def age_s(self, now_ns: int) -> float | None:
        """Return the age of the last message in seconds; None without one."""
        return None if self.received_ns is None else (now_ns - self.received_ns) / NS_PER_S

    def in_conflict(self, now_ns: int, lease_s: float = 0.0) -> bool:
        """Return whether two publishers were active within ``CONFLICT_NS``, or a longer lease."""
        window_ns = max(CONFLICT_NS, lease_s * NS_PER_S)
        return self.conflict_ns is not None and now_ns - self.conflict_ns < window_ns

    def accept(
        self: C, message: SourceMessage, received_ns: int, lease_s: float, max_age_ns: int
    ) -> tuple[C, str]:
        """Return the channel after a message, and the reason of its refusal; empty if accepted.

        A new publisher starts with the defaults of all further fields.
        """
        rises = message.boot == self.boot and message.seq > self.seq
        if message.boot != self.boot:
            if self.is_fresh(received_ns, lease_s):
                return replace(self, conflict_ns=received_ns), "second_publisher"
        elif not rises and self.is_fresh(received_ns, max_age_ns / NS_PER_S):
            return self, "seq_not_rising"
        channel = self if rises else type(self)(boot=message.boot, conflict_ns=self.conflict_ns)
        return replace(channel, seq=message.seq, received_ns=received_ns), ""


class Admission(Struct, frozen=True):
    """What a message is checked against, whatever it contains."""

    heartbeat: Heartbeat
    max_age_ns: int  # of the echoed heartbeat
    now_ns: int

    def refusal(self, source: str, known: Container[str], message: SourceMessage | None) -> str:
        """Return why a message is refused; empty if it is not."""
        if source not in known:
            return "unknown_source"
        if message is None:
            return "not_a_request"
        late = self.heartbeat.is_late(message.echo, self.now_ns, self.max_age_ns)
        return "late" if late else ""

    def sent_ns(self, message: SourceMessage) -> int:
        """Return when safety sent the heartbeat that an admitted message echoes."""
        return self.now_ns - (self.heartbeat.age_ns(message.echo, self.now_ns) or 0)


LAPSE_S = 1.0  # without a valid request: a neutral one is due again


class DriveChannel(Channel, frozen=True, kw_only=True):
    """State of one source, with its newest request."""

    requested: Twist = STILL
    release: ReleaseRequest = "none"  # instead of ``requested``, which is zero then
    neutral_ns: int | None = None  # reception of its newest neutral request that counts
    overruled_by: str = ""  # the source that was in control since this one was neutral

    @property
    def requests_motion(self) -> bool:
        """Whether it requests any motion; a request without is neutral."""
        return self.release != "none" or not self.requested.is_zero


class Arbiter(Struct, frozen=True):
    """State of all sources in the settings."""

    sources: Mapping[str, Source]
    channels: Mapping[str, DriveChannel] = {}
    barred_ns: int = 0  # the last decision with a cause that wants a neutral request
    rested_ns: int = 0  # when the vehicle was last known to stand

    def accept(self, request: DriveRequest, admission: Admission) -> tuple["Arbiter", str]:
        """Check a request; return the reason of its refusal, empty when accepted."""
        name, drive = request.source, request.message
        refused = admission.refusal(name, self.sources, drive)
        if refused or drive is None:
            return self, refused
        before, lease_s = self.channels.get(name, DriveChannel()), self.sources[name].lease
        channel, refused = before.accept(drive, request.received_ns, lease_s, admission.max_age_ns)
        if not refused:
            if self._resumes(before, request.received_ns, lease_s):
                channel = replace(channel, neutral_ns=None)
            channel = _requesting(channel, drive, request.received_ns)
        return replace(self, channels={**self.channels, name: channel}), refused

    def _resumes(self, channel: DriveChannel, received_ns: int, lease_s: float) -> bool:
        """Return whether a source must not drive on by itself after its silence.

        The vehicle has come to rest meanwhile, or the program was suspended. A gap in which the
        vehicle never stood changes nothing, or each stall of the host would end a program.
        """
        if channel.received_ns is None or channel.is_fresh(received_ns, lease_s):
            return False
        over_ns = channel.received_ns + lease_s * NS_PER_S
        return self.rested_ns > over_ns or not channel.is_fresh(received_ns, lease_s + LAPSE_S)

    def at_rest(self, now_ns: int) -> "Arbiter":
        """Return the arbiter of a vehicle that stands now."""
        return replace(self, rested_ns=now_ns)

    def in_control(self, now_ns: int) -> str | None:
        """Return the fresh source of the highest priority."""
        fresh = self._fresh(now_ns)
        return max(fresh, key=lambda name: self.sources[name].priority, default=None)

    def requests_motion(self, now_ns: int) -> bool:
        """Return whether any source requests motion."""
        return any(self.channels[name].requests_motion for name in self._fresh(now_ns))

    def conflict(self, now_ns: int) -> list[str]:
        """Return the source in control if it has two publishers; others are stopped anyway."""
        leader = self.in_control(now_ns)
        return [leader] if leader and self.channels[leader].in_conflict(now_ns) else []

    def barred(self, now_ns: int) -> "Arbiter":
        """Return the arbiter with a neutral request due on every source, received from now on."""
        return replace(self, barred_ns=now_ns)

    def is_neutral(self, source: str) -> bool:
        """Return whether the source has sent the neutral request that is due before motion."""
        neutral_ns = self.channels[source].neutral_ns
        return neutral_ns is not None and neutral_ns > self.barred_ns

    def requesting_zero(self, now_ns: int) -> set[str]:
        """Return the sources that request zero now."""
        return {name for name in self._fresh(now_ns) if not self.channels[name].requests_motion}

    def overruled(self, now_ns: int) -> "Arbiter":
        """Return the arbiter with a neutral request due on sources below the one in control."""
        leader = self.in_control(now_ns)
        if leader is None:
            return self
        priority = self.sources[leader].priority
        below = {
            name: replace(one, neutral_ns=None, overruled_by=leader)
            for name, one in self.channels.items()
            if self.sources[name].priority < priority
        }
        return replace(self, channels={**self.channels, **below}) if below else self

    def _fresh(self, now_ns: int) -> list[str]:
        return [
            name
            for name, one in self.channels.items()
            if one.is_fresh(now_ns, self.sources[name].lease)
        ]


def _requesting(channel: DriveChannel, drive: Drive, received_ns: int) -> DriveChannel:
    """Return the channel with a new request."""
    twist = Twist(drive.linear, drive.angular) if drive.release == "none" else STILL
    channel = replace(channel, requested=twist, release=drive.release)
    if channel.requests_motion:
        return channel
    return replace(channel, neutral_ns=received_ns, overruled_by="")


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
                channel = replace(channel, received_ns=admission.sent_ns(limit))
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
        stopping = tuple(f"{name}{one.because}" for name, one in self._valid(now_ns) if one.stops)
        by = (Phrase("limit_stop.by", {"sources": stopping}),)
        yield Observation("limit_stop", bool(stopping), phrases=by)
        silent = tuple(self._silent(now_ns))
        of = (Phrase("limit_silent.of", {"sources": silent}),)
        yield Observation("limit_silent", bool(silent), phrases=of)
        lost = tuple(self._lost(now_ns))
        kept = (Phrase("estop_keepalive.lost", {"names": lost}),)
        yield Observation("estop_keepalive", bool(lost), phrases=kept)

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
        stopping = {name for name, one in valid.items() if one.stops}
        stopping.update(self._silent(now_ns), self.missing)
        lost = self._lost(now_ns)
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
                effect=(
                    "brake"
                    if name in lost
                    else "stop"
                    if name in stopping
                    else "slow"
                    if name == slowing
                    else "none"
                ),
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
