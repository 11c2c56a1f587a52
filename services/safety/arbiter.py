"""Who drives: requests are judged one by one, and the best source with a fresh one drives.

A request that is refused leaves everything as it was, and is counted by its reason:

================ =============================================================================
unknown_source   no such source in the settings
not_a_request    payload of the wrong type
not_finite       NaN or infinity
late             the echo is unknown or too old, see ``heartbeat.py``
second_publisher another ``boot`` while the lease of the first one lives; stops the vehicle too
seq_not_rising   a repetition, or older than the one before
================ =============================================================================

A source holds the wheel as long as its last request is younger than its lease; letting go is
silence. A source may move the vehicle only after a *neutral* request, one of zero: after its
own start, after every cause that asks for it, and after a source of higher priority has held the
wheel.

A lease counts from when a request was received; time in the queue is part of it.
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
from services.safety.inputs import Ask

RIVAL_NS = NS_PER_S // 2  # only one publisher must be left for this long


class Channel(Struct, frozen=True):
    """One source as safety knows it."""

    boot: int | None = None
    seq: int = 0
    wish: Twist = STILL
    received_ns: int | None = None  # of the last accepted request
    rival_ns: int | None = None  # when a second publisher was last heard
    neutral: bool = False
    overruled_by: str = ""  # the source that held the wheel since this one was neutral

    def is_fresh(self, now_ns: int, lease_s: float) -> bool:
        """Tell whether the last request still holds."""
        return self.received_ns is not None and now_ns - self.received_ns <= lease_s * NS_PER_S

    def has_rival(self, now_ns: int) -> bool:
        """Tell whether two publishers have been heard of late."""
        return self.rival_ns is not None and now_ns - self.rival_ns < RIVAL_NS


class Arbiter(Struct, frozen=True):
    """All sources of the settings."""

    sources: Mapping[str, Source]
    channels: Mapping[str, Channel] = {}

    def take(
        self, ask: Ask, heartbeat: Heartbeat, max_age_ns: int, now_ns: int
    ) -> tuple["Arbiter", str]:
        """Judge a request; return why it was refused, or an empty reason."""
        if ask.source not in self.sources:
            return self, "unknown_source"
        drive = ask.drive
        if drive is None:
            return self, "not_a_request"
        if not codec.finite(drive.linear, drive.angular):
            return self, "not_finite"
        if heartbeat.is_late(drive.echo, now_ns, max_age_ns):
            return self, "late"
        channel, refused = self._accept(ask.source, drive, ask.received_ns)
        return replace(self, channels={**self.channels, ask.source: channel}), refused

    def _accept(self, name: str, drive: Drive, received_ns: int) -> tuple[Channel, str]:
        channel = self.channels.get(name, Channel())
        if drive.boot != channel.boot:
            if channel.is_fresh(received_ns, self.sources[name].lease):
                return replace(channel, rival_ns=received_ns), "second_publisher"
            channel = Channel(boot=drive.boot, rival_ns=channel.rival_ns)
        elif drive.seq <= channel.seq:
            return channel, "seq_not_rising"
        wish = Twist(drive.linear, drive.angular)
        return replace(channel, seq=drive.seq, wish=wish, received_ns=received_ns), ""

    def driver(self, now_ns: int) -> str | None:
        """Return the source that holds the wheel."""
        fresh = self._fresh(now_ns)
        return max(fresh, key=lambda name: self.sources[name].priority, default=None)

    def asks_to_move(self, now_ns: int) -> bool:
        """Tell whether any source asks for motion."""
        return any(not self.channels[name].wish.is_zero for name in self._fresh(now_ns))

    def rivals(self, now_ns: int) -> str:
        """Name the sources that two publishers ask on; empty when there are none."""
        return ", ".join(name for name, one in self.channels.items() if one.has_rival(now_ns))

    def disarmed(self) -> "Arbiter":
        """Return it with a neutral request due on every source."""
        channels = {name: replace(one, neutral=False) for name, one in self.channels.items()}
        return replace(self, channels=channels)

    def asking_for_zero(self, now_ns: int) -> set[str]:
        """Return the sources that request zero now."""
        return {name for name in self._fresh(now_ns) if self.channels[name].wish.is_zero}

    def armed(self, now_ns: int) -> "Arbiter":
        """Return it with the sources armed that ask for zero now."""
        neutral = self.asking_for_zero(now_ns)
        channels = {
            name: replace(one, neutral=True, overruled_by="") if name in neutral else one
            for name, one in self.channels.items()
        }
        return replace(self, channels=channels)

    def overruled(self, now_ns: int) -> "Arbiter":
        """Return it with a neutral request due on every source below the one at the wheel."""
        driver = self.driver(now_ns)
        if driver is None:
            return self
        priority = self.sources[driver].priority
        below = {
            name: replace(one, neutral=False, overruled_by=driver)
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
