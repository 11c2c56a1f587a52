"""False and missing echoes: soft targets, the floor, and the pulses of the neighbours.

All three are known from sonars in general, and the manual excludes none. What is off draws nothing.
"""

import math
import random
from collections.abc import Sequence

from sim.config import Sonar


class Echoes:
    """The first echo that each sonar of a ring takes, round by round."""

    def __init__(self, settings: Sonar, seed: int) -> None:
        self._settings = settings
        self._random = random.Random(f"echoes {seed}")
        self._lost: dict[int, int] = {}  # readings without an echo that remain, by sonar

    def taken(self, distances: Sequence[float]) -> list[float]:
        """Return the distances (m) that are measured; infinity without an echo."""
        own = [self._own(index, distance) for index, distance in enumerate(distances)]
        return [self._crossed(index, own) for index in range(len(own))]

    def _own(self, index: int, distance: float) -> float:
        if self._is_lost(index):
            distance = math.inf
        return min(distance, self._settings.floor_range) if self._floor() else distance

    def _is_lost(self, index: int) -> bool:
        if not self._lost.get(index) and self._happens(self._settings.vanish):
            self._lost[index] = self._settings.vanish_readings
        remaining = self._lost.pop(index, 0)
        if remaining > 1:
            self._lost[index] = remaining - 1
        return remaining > 0

    def _floor(self) -> bool:
        return self._happens(self._settings.floor_chance)

    def _crossed(self, index: int, own: Sequence[float]) -> float:
        if not self._happens(self._settings.cross_talk):
            return own[index]
        neighbour = self._random.choice((index - 1, index + 1)) % len(own)
        return min(own[index], own[neighbour])

    def _happens(self, chance: float) -> bool:
        return chance > 0 and self._random.random() < chance
