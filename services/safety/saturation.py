"""The reading that the sonars give when nothing is in their range, where that is not "no echo".

What the real sensors report then is unknown. A range that two of them share to the millimetre for a
second, and that none exceeds, is taken for their greatest one. A single frozen sonar does not make
one, and an echo of a real surface seldom does; then only that exact value counts as explained.
"""

import math
from collections.abc import Sequence

from msgspec import Struct

from services.safety.sonar import SAME_M

SHARED_SAMPLES = 20  # a second


class Saturation(Struct, frozen=True):
    """The greatest range, as far as it is known."""

    reading: float | None = None  # m
    candidate: float = 0.0  # m, what at least two sonars share now
    samples: int = 0  # in a row with that candidate

    def after(self, readings: Sequence[float]) -> "Saturation":
        """Return the state after one sample of all sonars; infinity: no echo, 0: no reading."""
        top = max(readings)
        known = None if self.reading is not None and top > self.reading + SAME_M else self.reading
        sharing = sum(top - one < SAME_M for one in readings)
        if math.isinf(top) or sharing < 2:
            return Saturation(known)
        if abs(top - self.candidate) >= SAME_M:
            return Saturation(known, top, 1)
        samples = self.samples + 1
        reached = samples >= SHARED_SAMPLES
        return Saturation(self.candidate if reached else known, self.candidate, samples)

    def explains(self, reading: float) -> bool:
        """Return whether a reading is the greatest one."""
        return self.reading is not None and abs(reading - self.reading) < SAME_M
