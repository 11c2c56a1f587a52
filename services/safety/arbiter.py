"""Arbiter: accepts or refuses drive requests, and selects the source in control.

The reasons of refusals are those of ``channel.py``.

The fresh source of the highest priority is in control. A source is fresh while its last request is
younger than its lease; it gives up control by silence. A source may move the vehicle only after a
*neutral* request (zero): after its own start, after every cause that requires it, after a source of
higher priority was in control, and when its lease has been over for ``LAPSE_S``.
"""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from common.messages import Drive, ReleaseRequest
from common.motion import STILL, Twist
from services.safety.channel import Admission, Channel
from services.safety.config import Source
from services.safety.inputs import DriveRequest

LAPSE_S = 1.0  # without a valid request: a neutral one is due again


class DriveChannel(Channel, frozen=True, kw_only=True):
    """State of one source, with its newest request."""

    requested: Twist = STILL
    release: ReleaseRequest = "none"  # instead of ``requested``, which is zero then
    neutral: bool = False
    neutral_ns: int | None = None  # reception of its newest neutral request
    overruled_by: str = ""  # the source that was in control since this one was neutral

    @property
    def requests_motion(self) -> bool:
        """Whether it requests any motion; a request without is neutral."""
        return self.release != "none" or not self.requested.is_zero


class Arbiter(Struct, frozen=True):
    """State of all sources in the settings."""

    sources: Mapping[str, Source]
    channels: Mapping[str, DriveChannel] = {}

    def accept(self, request: DriveRequest, admission: Admission) -> tuple["Arbiter", str]:
        """Check a request; return the reason of its refusal, empty when accepted."""
        name, drive = request.source, request.drive
        values = (drive.linear, drive.angular) if drive else ()
        refused = admission.refusal(name, self.sources, drive, *values)
        if refused or drive is None:
            return self, refused
        before, lease_s = self.channels.get(name, DriveChannel()), self.sources[name].lease
        channel, refused = before.accept(drive, request.received_ns, lease_s, admission.max_age_ns)
        if not refused:
            # A program that was suspended must not drive on by itself.
            if not before.is_fresh(request.received_ns, lease_s + LAPSE_S):
                channel = replace(channel, neutral=False, neutral_ns=None)
            channel = _requesting(channel, drive, request.received_ns)
        return replace(self, channels={**self.channels, name: channel}), refused

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

    def disarmed(self) -> "Arbiter":
        """Return the arbiter with a neutral request due on every source."""
        channels = {name: replace(one, neutral=False) for name, one in self.channels.items()}
        return replace(self, channels=channels)

    def requesting_zero(self, now_ns: int) -> set[str]:
        """Return the sources that request zero now."""
        return {name for name in self._fresh(now_ns) if not self.channels[name].requests_motion}

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
            name: replace(one, neutral=False, neutral_ns=None, overruled_by=leader)
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
    return channel if channel.requests_motion else replace(channel, neutral_ns=received_ns)
