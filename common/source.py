"""A source of drive requests: the publisher that every driving program uses."""

from collections.abc import Callable

from common import codec, keys
from common.bus.bus import Arrival, Bus
from common.messages import Drive, SafetyState

DENIED_AFTER = 10  # requests; a router needs a moment to announce its subscribers


class DriveSource:
    """Publisher of drive requests under a source's name, with the echo of safety's heartbeat.

    The echo bounds the age of a request without synchronized clocks. No method blocks: without a
    bus a request is dropped. A router whose access rules forbid driving drops requests without an
    error, and does not announce safety's subscription either.
    """

    def __init__(self, bus: Bus, source: str, on_denied: Callable[[], None] = lambda: None) -> None:
        self.name = source
        self._publisher = bus.publisher(keys.DRIVE, source=source)
        self._echo = 0  # before the first state of safety; safety refuses 0
        self._dropped = 0  # requests in a row
        self._on_denied = on_denied
        bus.subscribe(keys.SAFETY, self._on_safety)

    def request(self, linear: float, angular: float) -> Drive:
        """Request a motion (m/s, rad/s, in ``base_link``) until the source's lease expires."""
        if not codec.finite(linear, angular):
            raise ValueError(f"non-finite request: {linear} m/s, {angular} rad/s")
        was_denied = self.denied
        self._dropped = self._dropped + 1 if self._publisher.passed_on is False else 0
        sent = self._publisher.put(Drive(linear=linear, angular=angular, echo=self._echo))
        if self.denied and not was_denied:
            self._on_denied()
        return sent

    @property
    def denied(self) -> bool:
        """Whether safety's state arrives but our requests do not: watching only."""
        return self._echo != 0 and self._dropped >= DENIED_AFTER

    def _on_safety(self, arrival: Arrival[SafetyState]) -> None:
        self._echo = arrival.message.heartbeat
