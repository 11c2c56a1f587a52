"""Channel of one source: which messages of another program count.

Each message carries ``boot`` and ``seq`` of its publisher, and echoes a heartbeat of
safety. A refused message changes nothing except where noted. It is counted by its reason:

================ =============================================================================
unknown_source   the settings contain no such source
not_a_request    payload of the wrong type, NaN or infinity
late             the echo is unknown or too old, see ``common/heartbeat.py``
second_publisher another ``boot`` while the lease of the first one lives; also stops the vehicle
seq_not_rising   a repeated or an older number, until the last message is older than ``max_age_ns``
================ =============================================================================

A lease counts from the reception of a message, so time in the queue is part of it; that of a
keepalive counts from the heartbeat that it echoes. After ``max_age_ns`` a number that does not rise
belongs to a copy of the publisher, such as a fork or a restored snapshot: all earlier messages echo
a heartbeat that is too old by then.
"""

from collections.abc import Container
from typing import TypeVar

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from t2.messages import SourceMessage

C = TypeVar("C", bound="Channel")

CONFLICT_NS = NS_PER_S // 2  # one publisher must remain alone for this long


class Channel(Struct, frozen=True, kw_only=True):
    """State of one source."""

    boot: int | None = None
    seq: int = 0
    lease_ns: int | None = None  # from when the lease of the last accepted message counts
    conflict_ns: int | None = None  # when a second publisher last sent a message

    def is_fresh(self, now_ns: int, lease_s: float) -> bool:
        """Return whether the lease of the last message still lives."""
        return self.lease_ns is not None and now_ns - self.lease_ns <= lease_s * NS_PER_S

    def age_s(self, now_ns: int) -> float | None:
        """Return the age of the last message in seconds; None without one."""
        return None if self.lease_ns is None else (now_ns - self.lease_ns) / NS_PER_S

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
        return replace(channel, seq=message.seq, lease_ns=received_ns), ""


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
