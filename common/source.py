"""Drive request publisher for all programs that drive."""

from common import codec, keys
from common.bus.bus import Arrival, Bus
from common.messages import Drive, SafetyState

BARRED_AFTER = 10  # requests; the router needs a moment to report subscribers


class DriveSource:
    """Publishes drive requests of a source, and echoes safety's newest heartbeat.

    The echo gives safety the maximum age of a request, without synchronized clocks. Nothing here
    blocks: without a bus a request is dropped. A router whose access rules forbid driving drops it
    silently, but then it also reports no matching subscriber.
    """

    def __init__(self, bus: Bus, source: str) -> None:
        self.name = source
        self._publisher = bus.publisher(keys.DRIVE, source=source)
        self._echo = 0  # 0 until a state of safety is received; safety refuses it
        self._dropped = 0  # requests in a row
        bus.subscribe(keys.SAFETY, self._on_safety)

    def ask(self, linear: float, angular: float) -> Drive:
        """Request motion (m/s, rad/s, in ``base_link``) for the source's lease."""
        if not codec.finite(linear, angular):
            raise ValueError(f"{linear} m/s, {angular} rad/s is not a finite motion")
        self._dropped = self._dropped + 1 if self._publisher.passed_on is False else 0
        return self._publisher.put(Drive(linear=linear, angular=angular, echo=self._echo))

    @property
    def barred(self) -> bool:
        """Whether access rules block our requests: safety is received, but gets none of them."""
        return self._echo != 0 and self._dropped >= BARRED_AFTER

    def _on_safety(self, arrival: Arrival[SafetyState]) -> None:
        self._echo = arrival.message.heartbeat
