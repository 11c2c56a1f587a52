"""Arbiter: the source in control, and which one may move the vehicle.

The fresh source of the highest priority is in control. A source is fresh while its
last request is younger than its lease; it gives up control by silence. A source may move the
vehicle only after a *neutral* request (zero): after its own start, after every cause that requires
it, after a source of higher priority was in control, when its lease was over while the vehicle
stood, and when its lease has been over for ``LAPSE_S``.
"""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import STILL, Twist
from services.safety.config import Source
from services.safety.core.channel import Admission, Channel
from services.safety.core.inputs import DriveRequest
from t2.messages import (
    Drive,
    ReleaseRequest,
)

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
        if channel.lease_ns is None or channel.is_fresh(received_ns, lease_s):
            return False
        over_ns = channel.lease_ns + lease_s * NS_PER_S
        return self.rested_ns > over_ns or not channel.is_fresh(received_ns, lease_s + LAPSE_S)

    def at_rest(self, now_ns: int) -> "Arbiter":
        """Return the arbiter of a vehicle that stands now."""
        return replace(self, rested_ns=now_ns)

    def in_control(self, now_ns: int) -> str | None:
        """Return the fresh source of the highest priority."""
        fresh = self._fresh(now_ns)
        if len(fresh) < 2:
            return fresh[0] if fresh else None
        return max(fresh, key=lambda name: self.sources[name].priority)

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
