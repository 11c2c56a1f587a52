"""Sources of messages to safety: the publishers that their programs use."""

from collections.abc import Callable
from typing import Generic, TypeVar

from msgspec.structs import replace

from common.bus.bus import Arrival, Bus
from t2 import keys
from t2.client import Access, request
from t2.keys import Topic
from t2.messages import Drive, Limit, SafetyState, SourceMessage

M = TypeVar("M", bound=SourceMessage)


class Source(Generic[M]):
    """Publisher of a source's messages to safety, with the echo of safety's heartbeat.

    No method blocks: without a bus a message is dropped.
    """

    topic: Topic[M]

    def __init__(self, bus: Bus, source: str, on_denied: Callable[[], None] = lambda: None) -> None:
        self.name = source
        self._publisher = bus.publisher(self.topic, source=source)
        self._access = Access()
        self._on_denied = on_denied
        bus.subscribe(keys.SAFETY, self._on_safety)

    @property
    def denied(self) -> bool:
        """Whether safety's state arrives but our messages would not: watching only."""
        return self._access.is_denied

    def _put(self, message: M, echo: int | None = None) -> M:
        return self._publisher.put(
            replace(message, echo=self._access.echo if echo is None else echo)
        )

    def _on_safety(self, arrival: Arrival[SafetyState]) -> None:
        if self._access.received(arrival.message, self._publisher.passed_on):
            self._on_denied()


class DriveSource(Source[Drive]):
    """A source of drive requests."""

    topic = keys.DRIVE

    def request(self, linear: float, angular: float) -> Drive:
        """Request a motion (m/s, rad/s, in ``base_link``) until the source's lease expires."""
        return self.put(request(linear, angular))

    def put(self, drive: Drive, echo: int | None = None) -> Drive:
        """Put a request; its echo is the heartbeat that a screen showed, the newest by default."""
        return self._put(drive, echo)


class KeepalivePublisher(Source[Limit]):
    """A source of signs of life of an emergency stop."""

    topic = keys.LIMIT

    def beat(self, echo: int | None = None) -> Limit:
        """Send one, with the heartbeat that an operator's screen showed; the newest by default."""
        return self._put(Limit(echo=0), echo)
