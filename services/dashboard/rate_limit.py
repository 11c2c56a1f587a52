"""Token bucket for the messages of one connection.

========== ================================================ =========================
verdict    when, after the message has taken its token      what the connection does
========== ================================================ =========================
ACCEPTED   tokens are left                                  handles the message
DROPPED    the bucket is empty                              drops the message, counts
ABUSIVE    a whole burst was dropped and not made good      closes
========== ================================================ =========================

A dropped message takes a token, too: a client that returns to the rate is accepted again, and one
that does not is closed after two bursts.
"""

from dataclasses import dataclass, field
from enum import Enum

from common.freshness import NS_PER_S


class Verdict(Enum):
    """The verdict on a message."""

    ACCEPTED = "accepted"
    DROPPED = "dropped"
    ABUSIVE = "abusive"


@dataclass
class RateLimit:
    """The tokens of one connection."""

    rate: float  # tokens per second
    burst: float  # tokens in a full bucket
    _tokens: float = field(init=False)
    _filled_ns: int | None = None

    def __post_init__(self) -> None:
        self._tokens = self.burst

    def take(self, now_ns: int, cost: float = 1.0) -> Verdict:
        """Take tokens for one message."""
        if self._filled_ns is not None:
            gained = self.rate * (now_ns - self._filled_ns) / NS_PER_S
            self._tokens = min(self.burst, self._tokens + gained)
        self._filled_ns = now_ns
        self._tokens = max(-self.burst, self._tokens - cost)
        if self._tokens >= 0:
            return Verdict.ACCEPTED
        return Verdict.DROPPED if self._tokens > -self.burst else Verdict.ABUSIVE
