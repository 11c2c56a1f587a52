"""A source of requests to move: what every program that drives asks with."""

from common import codec, keys
from common.bus.bus import Arrival, Bus
from common.messages import Drive, SafetyState


class DriveSource:
    """Publishes requests under a source's name, and echoes the heartbeat that safety last sent.

    The echo tells safety how old a request can be at most, without synchronized clocks. Nothing
    here blocks: without a bus a request is dropped.
    """

    def __init__(self, bus: Bus, source: str) -> None:
        self.name = source
        self._publisher = bus.publisher(keys.DRIVE, source=source)
        self._echo = 0  # before safety was heard, which refuses it
        bus.subscribe(keys.SAFETY, self._hear)

    def ask(self, linear: float, angular: float) -> Drive:
        """Ask to move (m/s, rad/s, in ``base_link``) until the source's lease is over."""
        if not codec.finite(linear, angular):
            raise ValueError(f"{linear} m/s, {angular} rad/s is no motion")
        return self._publisher.put(Drive(linear=linear, angular=angular, echo=self._echo))

    def _hear(self, arrival: Arrival[SafetyState]) -> None:
        self._echo = arrival.message.heartbeat
