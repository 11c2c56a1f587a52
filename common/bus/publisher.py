"""Typed publishing, in the class of service that the key table names."""

import time
from collections import Counter, deque
from typing import Any, Generic, TypeVar

import msgspec
import zenoh
import zenoh.ext

from common import codec
from common.keys import ClassOfService, Topic
from common.messages import Message

M = TypeVar("M", bound=Message)

# Of a query, and so of its answers: by Zenoh's default the router waits up to 5 s for a full link.
QUERY_CONGESTION = zenoh.CongestionControl.DROP


class Publisher(Generic[M]):
    """Puts the header on a topic's messages and sends them.

    While there is no bus it drops them, but for those of a class with a history: these wait.
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
    def next_seq(self) -> int:
        """The ``seq`` that the next message will carry."""
        return self._seq + 1

    @property
    def passed_on(self) -> bool | None:
        """Whether the router has anybody to pass messages to; None while there is no bus."""
        if not self._declared:
            return None
        return any(bool(each.matching_status.matching) for each in self._declared)

    def put(self, message: M, raw: bytes | None = None) -> M:
        """Send the message with a header of its own, ``raw`` beside it; return what was sent."""
        self._seq += 1
        stamped = msgspec.structs.replace(
            message,
            seq=self._seq,
            boot=self._boot,
            t_ns=time.time_ns(),
            mono_ns=time.monotonic_ns(),
            host=self._host,
        )
        self.last = stamped
        if not self._declared:
            self._waiting.append((stamped, raw))
        else:
            self._send(stamped, raw)
        return stamped

    def withdraw(self) -> None:
        """Send no more; the bus calls this before it ends its session."""
        self._declared.clear()

    def declare(self, session: zenoh.Session, *, first: bool = False) -> None:
        """Declare it; the bus calls this once it has a session.

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
            declared = session.declare_publisher(self.key, **options)
        self._declared.insert(0 if first else len(self._declared), declared)
        while self._waiting:
            self._send(*self._waiting.popleft())

    def _send(self, message: M, raw: bytes | None) -> None:
        self._counts[self.key] += 1
        payload = codec.encode(message)
        for declared in self._declared:
            declared.put(payload, attachment=raw)


def qos(service: ClassOfService) -> dict[str, Any]:
    """Return a class of service in Zenoh's own words."""
    return {
        "priority": getattr(zenoh.Priority, service.priority),
        "congestion_control": zenoh.CongestionControl.DROP,
        "express": service.express,
    }
