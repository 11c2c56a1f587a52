"""Typed publishers, with the class of service of the key table."""

import time
import uuid
from collections import Counter, deque
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec
import zenoh
import zenoh.ext

from common import clock
from t2 import codec
from t2.keys import ClassOfService, Topic
from t2.messages import Message

M = TypeVar("M", bound=Message)

# For queries and their answers; by default Zenoh's router blocks up to 5 s on a full link.
QUERY_CONGESTION = zenoh.CongestionControl.DROP

# All processes of a host share one monotonic clock, which starts at the host's boot. Two hosts that
# were restored from one image may have the same id: check that a difference is plausible, too.
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class Publisher(Generic[M]):
    """Adds the header to a topic's messages and sends them.

    Without a session messages are dropped, except in a class with a history: these are queued.
    """

    def __init__(
        self, topic: Topic[M], key: str, boot: int, counts: Counter[str], host: int = 0
    ) -> None:
        self.key = key
        self.last: M | None = None
        self.topic = topic
        self._boot = boot
        self._host = host
        self._seq = 0
        self._counts = counts
        self._declared: list[Any] = []  # on each session, in the order of sending
        self._waiting: deque[tuple[M, bytes | None]] = deque(maxlen=topic.service.history)

    @property
    def passed_on(self) -> bool | None:
        """Whether a subscriber matches; None without a session."""
        if not self._declared:
            return None
        return any(bool(each.matching_status.matching) for each in self._declared)

    def put(self, message: M, raw: bytes | None = None) -> M:
        """Send the message with a header, and ``raw`` as attachment; return what was sent."""
        self._seq += 1
        stamped = msgspec.structs.replace(
            message,
            seq=self._seq,
            boot=self._boot,
            t_ns=time.time_ns(),
            mono_ns=clock.now_ns(),
            host=self._host,
        )
        self.last = stamped
        if not self._declared:
            self._waiting.append((stamped, raw))
        else:
            self._send(stamped, raw)
        return stamped

    def withdraw(self) -> None:
        """Stop sending; the bus calls this before it closes its session."""
        self._declared.clear()

    def declare(self, session: zenoh.Session, *, first: bool = False) -> None:
        """Declare the publisher; the bus calls this once it has a session.

        With ``first`` each message goes to this session before it goes to any other.
        """
        service = self.topic.service
        options = qos(service) | {"encoding": codec.encoding(self.topic.message)}
        if service.history:
            cache = zenoh.ext.CacheConfig(max_samples=service.history)
            declared: Any = zenoh.ext.declare_advanced_publisher(
                session, self.key, cache=cache, publisher_detection=True, **options
            )
        else:
            locality = zenoh.Locality.REMOTE if service.remote else zenoh.Locality.DEFAULT
            declared = session.declare_publisher(self.key, allowed_destination=locality, **options)
        self._declared.insert(0 if first else len(self._declared), declared)
        while self._waiting:
            self._send(*self._waiting.popleft())

    def _send(self, message: M, raw: bytes | None) -> None:
        self._counts[self.key] += 1
        payload = codec.encode(message)
        for declared in self._declared:
            declared.put(payload, attachment=raw)


def qos(service: ClassOfService) -> dict[str, Any]:
    """Return Zenoh's options for a class of service."""
    return {
        "priority": getattr(zenoh.Priority, service.priority),
        "congestion_control": zenoh.CongestionControl.DROP,
        "express": service.express,
    }


def host_id(boot_id: Path = BOOT_ID) -> int:
    """Return an id of this boot of this host; 0 where it is unknown (not Linux)."""
    try:
        return uuid.UUID(boot_id.read_text(encoding="ascii").strip()).int >> 65  # fits an int64
    except (OSError, ValueError):
        return 0
