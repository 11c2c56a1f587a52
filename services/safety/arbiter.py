"""Arbiter: accepts or refuses drive requests, and selects the source in control.

A refused request changes nothing except where noted. It is counted by its reason:

================ =============================================================================
unknown_source   the settings contain no such source
not_a_request    payload of the wrong type
not_finite       NaN or infinity
late             the echo is unknown or too old, see ``common/heartbeat.py``
second_publisher another ``boot`` while the lease of the first one lives; also stops the vehicle
seq_not_rising   a repeated or an older sequence number
================ =============================================================================

The fresh source of the highest priority is in control. A source is fresh while its last request is
younger than its lease; it gives up control by silence. A source may move the vehicle only after a
*neutral* request (zero): after its own start, after every cause that requires it, and after a
source of higher priority was in control.

A lease counts from the reception of a request, so time in the queue is part of it.
"""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from common import codec
from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from common.messages import Drive
from common.motion import STILL, Twist
from services.safety.config import Source
from services.safety.inputs import DriveRequest

CONFLICT_NS = NS_PER_S // 2  # one publisher must remain alone for this long


class Channel(Struct, frozen=True):
    """State of one source."""

    boot: int | None = None
    seq: int = 0
    requested: Twist = STILL
    received_ns: int | None = None  # of the last accepted request
    conflict_ns: int | None = None  # when a second publisher last sent a request
    neutral: bool = False
    overruled_by: str = ""  # the source that was in control since this one was neutral

    def is_fresh(self, now_ns: int, lease_s: float) -> bool:
        """Return whether the lease of the last request still lives."""
        return self.received_ns is not None and now_ns - self.received_ns <= lease_s * NS_PER_S

    def in_conflict(self, now_ns: int) -> bool:
        """Return whether two publishers were active within ``CONFLICT_NS``."""
        return self.conflict_ns is not None and now_ns - self.conflict_ns < CONFLICT_NS


class Arbiter(Struct, frozen=True):
    """State of all sources in the settings."""

    sources: Mapping[str, Source]
    channels: Mapping[str, Channel] = {}

    def accept(
        self, request: DriveRequest, heartbeat: Heartbeat, max_age_ns: int, now_ns: int
    ) -> tuple["Arbiter", str]:
        """Check a request; return the reason of its refusal, empty when accepted."""
        if request.source not in self.sources:
            return self, "unknown_source"
        drive = request.drive
        if drive is None:
            return self, "not_a_request"
        if not codec.finite(drive.linear, drive.angular):
            return self, "not_finite"
        if heartbeat.is_late(drive.echo, now_ns, max_age_ns):
            return self, "late"
        channel, refused = self._accept(request.source, drive, request.received_ns)
        return replace(self, channels={**self.channels, request.source: channel}), refused

    def _accept(self, name: str, drive: Drive, received_ns: int) -> tuple[Channel, str]:
        channel = self.channels.get(name, Channel())
        if drive.boot != channel.boot:
            if channel.is_fresh(received_ns, self.sources[name].lease):
                return replace(channel, conflict_ns=received_ns), "second_publisher"
            channel = Channel(boot=drive.boot, conflict_ns=channel.conflict_ns)
        elif drive.seq <= channel.seq:
            return channel, "seq_not_rising"
        twist = Twist(drive.linear, drive.angular)
        return replace(channel, seq=drive.seq, requested=twist, received_ns=received_ns), ""

    def in_control(self, now_ns: int) -> str | None:
        """Return the fresh source of the highest priority."""
        fresh = self._fresh(now_ns)
        return max(fresh, key=lambda name: self.sources[name].priority, default=None)

    def requests_motion(self, now_ns: int) -> bool:
        """Return whether any source requests motion."""
        return any(not self.channels[name].requested.is_zero for name in self._fresh(now_ns))

    def conflicts(self, now_ns: int) -> str:
        """Return the names of sources with two publishers, joined by commas."""
        return ", ".join(name for name, one in self.channels.items() if one.in_conflict(now_ns))

    def disarmed(self) -> "Arbiter":
        """Return the arbiter with a neutral request due on every source."""
        channels = {name: replace(one, neutral=False) for name, one in self.channels.items()}
        return replace(self, channels=channels)

    def requesting_zero(self, now_ns: int) -> set[str]:
        """Return the sources that request zero now."""
        return {name for name in self._fresh(now_ns) if self.channels[name].requested.is_zero}

    def armed(self, now_ns: int) -> "Arbiter":
        """Return the arbiter with the sources armed that request zero now."""
        neutral = self.requesting_zero(now_ns)
        channels = {
            name: replace(one, neutral=True, overruled_by="") if name in neutral else one
            for name, one in self.channels.items()
        }
        return replace(self, channels=channels)

    def overruled(self, now_ns: int) -> "Arbiter":
        """Return the arbiter with a neutral request due on sources below the one in control."""
        leader = self.in_control(now_ns)
        if leader is None:
            return self
        priority = self.sources[leader].priority
        below = {
            name: replace(one, neutral=False, overruled_by=leader)
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
