"""What is sent while a hold drives and after: the wish of an operator, tick by tick.

On every tick, 20 times a second, at most one request goes out:

========== ========================= =========================================
phase      tick, something is held   tick, nothing is held
========== ========================= =========================================
SILENT     send zero; DRIVING        send nothing
DRIVING    send the twist            send zero; RELEASING, two zeros are left
RELEASING  send zero; DRIVING        send zero; SILENT once none is left
========== ========================= =========================================

The zero ahead of a drive is neutral: it lets safety and the bridge arm. ``stop`` is RELEASING with
three zeros, in any phase.
"""

from dataclasses import dataclass
from enum import Enum

from common.motion import STILL, Twist

ZEROS = 3  # on release: one may be lost, two are a doubt


class Phase(Enum):
    """What the last tick left behind."""

    SILENT = "silent"
    DRIVING = "driving"
    RELEASING = "releasing"


@dataclass
class Requests:
    """What to send, tick by tick."""

    phase: Phase = Phase.SILENT
    zeros: int = 0  # left to send while RELEASING

    def tick(self, held: Twist | None) -> Twist | None:
        """Return the request to send now, or None for silence; ``held`` is None when let go."""
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
        """Send zeros and then fall silent, whatever went before."""
        self.phase, self.zeros = Phase.RELEASING, ZEROS
