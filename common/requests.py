"""Drive requests of an operator program, tick by tick: during a hold and after its release.

On every tick, 20 times a second, at most one request is sent:

========== ========================= =========================================
phase      tick, something is held   tick, nothing is held
========== ========================= =========================================
SILENT     send zero; DRIVING        send nothing
DRIVING    send the twist            send zero; RELEASING, two zeros are left
RELEASING  send zero; DRIVING        send zero; SILENT once none is left
========== ========================= =========================================

The zero before a drive is neutral: it arms safety and the bridge. ``stop`` enters RELEASING with
three zeros from any phase.
"""

from dataclasses import dataclass
from enum import Enum

from common.motion import STILL, Twist

ZEROS = 3  # on release; tolerates two lost ones


class Phase(Enum):
    """Phase after the last tick."""

    SILENT = "silent"
    DRIVING = "driving"
    RELEASING = "releasing"


@dataclass
class Requests:
    """State machine of the requests."""

    phase: Phase = Phase.SILENT
    zeros: int = 0  # left to send while RELEASING

    def tick(self, held: Twist | None) -> Twist | None:
        """Return the request to send now, or None for silence; ``held`` is None when released."""
        if held is not None:
            first = self.phase is not Phase.DRIVING
            self.phase = Phase.DRIVING
            return STILL if first else held
        if self.phase is Phase.DRIVING:
            self.stop()
        if self.phase is Phase.SILENT:
            return None
        self.zeros -= 1
        if self.zeros == 0:
            self.phase = Phase.SILENT
        return STILL

    def stop(self) -> None:
        """Send zeros, then fall silent, from any phase."""
        self.phase, self.zeros = Phase.RELEASING, ZEROS
