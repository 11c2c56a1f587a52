"""Emergency stops that must be kept alive, as a pendant with a radio link.

Each name in ``safety.estop_keepalive`` must be received on ``@cmd/estop_keepalive/{name}``. Before
its first message the cause ``starting`` inhibits. From then on its silence latches
``estop_keepalive`` and brakes. Its time counts from when safety sent the heartbeat that a message
echoes, not from the reception: a message that a proxy held for 3 s proves nothing about now.

A name belongs to one running program. A message of another one, or one after a gap, shows that the
first program ended or that two operators rely on one name: it latches too.
"""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from common.messages import KeepaliveState
from services.safety.channel import Admission, Channel
from services.safety.inputs import KeepaliveRequest
from services.safety.latches import Observation


class Keepalives(Struct, frozen=True):
    """State of all names in the settings."""

    names: tuple[str, ...]
    timeout_s: float
    channels: Mapping[str, Channel] = {}

    def accept(self, request: KeepaliveRequest, admission: Admission) -> tuple["Keepalives", str]:
        """Check a message; return the reason of its refusal, empty when accepted."""
        name, message, now_ns = request.source, request.message, request.received_ns
        refused = admission.refusal(name, self.names, message)
        if refused or message is None:
            return self, refused
        before = self.channels.get(name, Channel())
        broken = before.boot is not None and (
            before.boot != message.boot or not before.is_fresh(now_ns, self.timeout_s)
        )
        channel, refused = before.accept(message, now_ns, self.timeout_s, admission.max_age_ns)
        if broken:
            channel = replace(channel, conflict_ns=now_ns)
        if not refused:
            channel = replace(channel, received_ns=admission.sent_ns(message))
        return replace(self, channels={**self.channels, name: channel}), refused

    @property
    def missing(self) -> list[str]:
        """The names that were not received since the start."""
        return [name for name in self.names if name not in self.channels]

    def observation(self, now_ns: int) -> Observation:
        """Return the cause of the names that were received and are lost, present or not."""
        lost = [name for name in self.channels if not self._is_alive(name, now_ns)]
        text = f"The emergency stop is no longer kept alive by {', '.join(lost)}."
        return Observation("estop_keepalive", bool(lost), (0, now_ns), text)

    def states(self, now_ns: int) -> tuple[KeepaliveState, ...]:
        """Return the published states."""
        return tuple(
            KeepaliveState(
                source=name,
                age=self.channels.get(name, Channel()).age_s(now_ns),
                alive=self._is_alive(name, now_ns),
                timeout=self.timeout_s,
            )
            for name in self.names
        )

    def _is_alive(self, name: str, now_ns: int) -> bool:
        channel = self.channels.get(name, Channel())
        return channel.is_fresh(now_ns, self.timeout_s) and not channel.in_conflict(now_ns)
