"""Publishing to safety: header, echo, and what the router tells about who receives it."""

import time
from collections import defaultdict
from collections.abc import Iterator
from itertools import count
from secrets import randbits
from typing import Any, TypeVar

import msgspec
import zenoh

from t2.client import Access, DriveRequests
from t2.codec import encode, encoding
from t2.errors import NotAllowed
from t2.messages import Drive, Fix, Message, SafetyState, SourceMessage
from t2.stream import Stream, now_s

M = TypeVar("M", bound=Message)

PERIOD_S = 0.05  # 20 Hz, which safety's lease of 0.3 s requires
# A program is one publisher at a router: safety would take the next drive of a source for a second
# one. Made on first use: forks that connect afterwards are publishers of their own.
BOOTS: defaultdict[str, int] = defaultdict(lambda: randbits(56))  # by router
SEQS: defaultdict[str, Iterator[int]] = defaultdict(lambda: count(1))  # by key
MATCH_S = 1.0  # until the router has announced the subscriber
FRESH_S = 0.5  # age of safety's state; older, and safety counts as silent
QOS: dict[str, Any] = {
    "priority": zenoh.Priority.INTERACTIVE_HIGH,
    "congestion_control": zenoh.CongestionControl.DROP,
    "express": True,
    # A subscriber of this session is no receiver.
    "allowed_destination": zenoh.Locality.REMOTE,
}


class SourcePublisher:
    """Sends a source's messages with the heartbeat of safety that was received last."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        kind: type[SourceMessage],
        safety: Stream[SafetyState],
    ) -> None:
        safety.open()
        self._safety = safety
        self.boot: int = BOOTS[str(session.info.routers_zid())]
        self._seqs = SEQS[key]
        self._access = Access()
        self._seen: SafetyState | None = None
        self._publisher: Any = session.declare_publisher(key, encoding=encoding(kind), **QOS)

    @property
    def denied(self) -> bool:
        """Whether safety is there, but the router does not pass our messages on to it."""
        return self._access.is_denied

    @property
    def matches(self) -> bool:
        """Whether the router announces a subscriber of safety for our messages."""
        return bool(self._publisher.matching_status.matching)

    def put(self, message: SourceMessage) -> None:
        """Send a message; its header and echo are filled in."""
        state = self._safety.newest
        if state is not None and state is not self._seen:
            self._seen = state
            self._access.received(state, self.matches)
        filled = stamped(message, self.boot, next(self._seqs), echo=self._access.echo)
        self._publisher.put(encode(filled))

    def close(self) -> None:
        """Send no more."""
        self._publisher.undeclare()


class DrivePublisher(SourcePublisher):
    """Sends drive requests, each drive between zeros."""

    def __init__(self, session: zenoh.Session, key: str, safety: Stream[SafetyState]) -> None:
        super().__init__(session, key, Drive, safety)
        self._requests = DriveRequests()

    def tick(self, requested: Drive | None) -> bool:
        """Send the request of this tick; return whether there is one."""
        request = self._requests.tick(requested)
        if request is not None:
            self.put(request)
        return request is not None

    def stop(self) -> None:
        """Send the final zeros."""
        self._requests.stop()
        while self.tick(None):
            time.sleep(PERIOD_S)


class FixPublisher:
    """Sends the fixes of one source, once the router announces a receiver."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.boot: int = BOOTS[str(session.info.routers_zid())]
        self._key, self._seqs = key, SEQS[key]
        self._publisher: Any = session.declare_publisher(
            key,
            encoding=encoding(Fix),
            priority=zenoh.Priority.DATA_HIGH,
            congestion_control=zenoh.CongestionControl.DROP,
            allowed_destination=zenoh.Locality.REMOTE,
        )

    def put(self, fix: Fix) -> None:
        """Send a fix; its header is filled in. Raises ``NotAllowed``."""
        end_s = now_s() + MATCH_S
        while not self._publisher.matching_status.matching:
            if now_s() > end_s:
                raise NotAllowed(
                    f"the router does not pass fixes on {self._key}: a certificate of role device "
                    "needs this source (`t2 keys list`)"
                )
            time.sleep(PERIOD_S)
        self._publisher.put(encode(stamped(fix, self.boot, next(self._seqs))))


def stamped(message: M, boot: int, seq: int, **fields: Any) -> M:
    """Return a message with its header."""
    return msgspec.structs.replace(
        message,
        seq=seq,
        boot=boot,
        t_ns=time.time_ns(),
        mono_ns=time.monotonic_ns(),
        **fields,
    )
