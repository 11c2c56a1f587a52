"""Independent sonars: what a ring of eight reports of the true ranges."""

import random
from dataclasses import dataclass, field

NO_ECHO_MM = 20_000
FAULTY = 0xFFFF
FRONT_CORNERS, FRONT = (1, 3), 2
CORNER = 1.414  # a wall straight ahead is so much farther at 45 degrees


@dataclass
class Ring:
    """The eight sonars; the defaults report the truth. Chances are those of a reading."""

    resolution_mm: int = 1
    longest_mm: int = NO_ECHO_MM
    floor: float = 0.0  # chance of an echo of the floor
    floor_mm: int = 1200
    crossed: float = 0.0  # chance of a neighbour's pulse
    absorbed: float = 0.0  # chance that an echo is lost
    absorbed_readings: int = 1  # and how long
    noise_mm: float = 0.0
    _missing: list[int] = field(default_factory=lambda: [0] * 8)

    def report(self, true: list[int]) -> list[int]:
        """Return a reading of each sonar, in mm."""
        return [self._reading(index, true) for index in range(8)]

    def _reading(self, index: int, true: list[int]) -> int:
        value = self._echo(index, true[index])
        if value == FAULTY:
            return value
        if random.random() < self.crossed:
            value = min(value, true[(index + random.choice((1, 7))) % 8])
        value = min(value, self.longest_mm)
        return value // self.resolution_mm * self.resolution_mm

    def _echo(self, index: int, value: int) -> int:
        if value == FAULTY:
            return value
        if self._missing[index] == 0 and random.random() < self.absorbed:
            self._missing[index] = self.absorbed_readings
        if self._missing[index]:
            self._missing[index] -= 1
            value = NO_ECHO_MM
        if random.random() < self.floor:
            value = min(value, self.floor_mm)
        if self.noise_mm and value < NO_ECHO_MM:
            value = max(1, round(random.gauss(value, self.noise_mm)))
        return value


def before(true: list[int], gap: float) -> list[int]:
    """Return the ranges with a wall straight ahead, in m, in front of the others."""
    seen = list(true)
    near = max(1, round(gap * 1000))
    seen[FRONT] = min(seen[FRONT], near)
    for index in FRONT_CORNERS:
        seen[index] = min(seen[index], round(near * CORNER))
    return seen
