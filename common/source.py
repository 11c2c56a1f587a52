"""A source of requests to move: what every program that drives asks with."""

from common import codec, keys
from common.bus.bus import Arrival, Bus
from common.messages import Drive, SafetyState

BARRED_AFTER = 10  # requests; it takes a moment until the router has told who listens


class DriveSource:
    """Publishes requests under a source's name, and echoes the heartbeat that safety last sent.

    The echo tells safety how old a request can be at most, without synchronized clocks. Nothing
    here blocks: without a bus a request is dropped. A router whose access rules forbid to drive
    drops it as well and does not say so, but it does not tell of safety's ears either.
    """

    def __init__(self, bus: Bus, source: str) -> None:
        self.name = source
        self._publisher = bus.publisher(keys.DRIVE, source=source)
        self._echo = 0  # before safety was heard, which refuses it
        self._dropped = 0  # requests in a row
        bus.subscribe(keys.SAFETY, self._hear)

    def ask(self, linear: float, angular: float) -> Drive:
        """Ask to move (m/s, rad/s, in ``base_link``) until the source's lease is over."""
        if not codec.finite(linear, angular):
            raise ValueError(f"{linear} m/s, {angular} rad/s is no motion")
        self._dropped = self._dropped + 1 if self._publisher.passed_on is False else 0
        return self._publisher.put(Drive(linear=linear, angular=angular, echo=self._echo))

    @property
    def barred(self) -> bool:
        """Whether safety is heard and does not get our requests: we may watch, not drive."""
        return self._echo != 0 and self._dropped >= BARRED_AFTER

    def _hear(self, arrival: Arrival[SafetyState]) -> None:
        self._echo = arrival.message.heartbeat
