"""Simulated sonars, eight around the vehicle.

Each sends a cone, here a fan of rays; the nearest surface in it is the echo, with noise. What the
real sensors report at the ends of their range is unknown; these report 0 when something is too near
to measure, and their maximum range without an echo.
"""

import math
import random
from collections.abc import Sequence

from common.settings import Mount, Vehicle, sonar_mounts
from common.wire.reports import SONAR_FAULT_MM
from sim import model
from sim.geometry import Pose, in_cone, ray
from sim.requests import Sonar
from sim.world import World
from t2.messages import SONAR_NAMES

RAYS = 7
TOO_NEAR_MM = 0

Ranges = tuple[int, ...]  # mm, of the eight in the manual's order


class Sonars:
    """The eight of them, in the manual's order, with what is injected with each."""

    def __init__(self, vehicle: Vehicle, parameters: model.Sonar, seed: int) -> None:
        self._mounts = sonar_mounts(vehicle)
        self._nearest = vehicle.sonar_min
        self._farthest = min(vehicle.sonar_max, parameters.saturation)
        self._quantum_mm = round(parameters.quantum * 1000)
        self._fan = tuple(parameters.cone * (k / (RAYS - 1) - 0.5) for k in range(RAYS))
        self._half = parameters.cone / 2
        self._noise = parameters.noise
        self._random = random.Random(seed)
        self._echoes = Echoes(parameters, seed)
        self._injected: dict[str, Sonar] = {}
        self._last = dict.fromkeys(SONAR_NAMES, self._in_mm(self._farthest))
        self._seen_from: tuple[World, Pose] | None = None
        self._distances: list[float] = []  # m, from there, without faults

    def inject(self, sonar: Sonar) -> None:
        """Set or clear the fault of one sonar."""
        self._injected[sonar.name] = sonar

    def measure(self, world: World, pose: Pose) -> Ranges:
        """Return the reported ranges from this pose."""
        if self._seen_from != (world, pose):  # it stands most of the time
            self._seen_from = world, pose
            self._distances = [self._distance(mount, world, pose) for mount in self._mounts]
        taken = self._echoes.taken(self._distances)
        return tuple(map(self._report, self._mounts, taken))

    def _report(self, mount: Mount, distance: float) -> int:
        noise = self._random.gauss(0.0, self._noise)  # always drawn: independent of faults
        injected = self._injected.get(mount.name)
        if injected is not None and injected.fault:
            return SONAR_FAULT_MM
        if injected is not None and injected.stuck:
            return self._last[mount.name]
        if injected is not None and injected.range is not None:
            value = self._in_mm(injected.range)
        else:
            value = self._in_mm(distance + noise)
        self._last[mount.name] = value
        return value

    def _distance(self, mount: Mount, world: World, pose: Pose) -> float:
        x, y = pose.outward(mount.x, mount.y)
        middle = pose.heading + mount.yaw
        seen = in_cone(x, y, middle, self._half, world.visible)
        return min(
            (ray(x, y, middle + aside, s) for aside in self._fan for s in seen),
            default=self._farthest,
        )

    def _in_mm(self, distance: float) -> int:
        if distance < self._nearest:
            return TOO_NEAR_MM
        mm = round(min(distance, self._farthest) * 1000)
        return round(mm / self._quantum_mm) * self._quantum_mm


class Echoes:
    """The first echo that each sonar of a ring takes, round by round.

    Soft targets, the floor and the pulses of the neighbours are known from sonars in general, and
    the manual excludes none. What is off draws no random number.
    """

    def __init__(self, parameters: model.Sonar, seed: int) -> None:
        self._parameters = parameters
        self._random = random.Random(f"echoes {seed}")
        self._lost: dict[int, int] = {}  # readings without an echo that remain, by sonar

    def taken(self, distances: Sequence[float]) -> list[float]:
        """Return the distances (m) that are measured; infinity without an echo."""
        own = [self._own(index, distance) for index, distance in enumerate(distances)]
        return [self._crossed(index, own) for index in range(len(own))]

    def _own(self, index: int, distance: float) -> float:
        if self._is_lost(index):
            distance = math.inf
        echoes = self._happens(self._parameters.floor_chance)
        return min(distance, self._parameters.floor_range) if echoes else distance

    def _is_lost(self, index: int) -> bool:
        if not self._lost.get(index) and self._happens(self._parameters.vanish):
            self._lost[index] = self._parameters.vanish_readings
        remaining = self._lost.pop(index, 0)
        if remaining > 1:
            self._lost[index] = remaining - 1
        return remaining > 0

    def _crossed(self, index: int, own: Sequence[float]) -> float:
        if not self._happens(self._parameters.cross_talk):
            return own[index]
        neighbour = self._random.choice((index - 1, index + 1)) % len(own)
        return min(own[index], own[neighbour])

    def _happens(self, chance: float) -> bool:
        return chance > 0 and self._random.random() < chance
