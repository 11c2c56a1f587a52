"""Independent vehicle: follows the last command, with unkind motors on request."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from verification.outside import wire

if TYPE_CHECKING:
    from verification.outside.board import Faults

TRACK = 0.56  # m, left wheels to right wheels
GRAVITY = 9.81
REST = 0.002  # m/s or rad/s; slower is standstill


@dataclass(frozen=True)
class Motors:
    """What lies between a command and the ground; the defaults are ideal."""

    dead_time: float = 0.0  # s
    lag: float = 0.0  # s
    dead_zone: float = 0.0  # m/s, of a side
    left: float = 1.0  # share of the commanded speed that the left side reaches
    right: float = 1.0
    slope: float = 0.0  # rad, downward ahead: STOP comes to rest, then the vehicle rolls
    rebound: float = 0.0  # share of the speed after a contact

    def sides(self, linear: float, angular: float) -> tuple[float, float]:
        """Return what both sides make of a RUN, as linear and angular velocity."""
        half = angular * TRACK / 2
        speeds = [0.0 if abs(v) < self.dead_zone else v for v in (linear - half, linear + half)]
        left, right = speeds[0] * self.left, speeds[1] * self.right
        return (left + right) / 2, (right - left) / TRACK


@dataclass
class Vehicle:
    """A vehicle that follows the last command; no watchdog on the board."""

    linear: float = 0.0
    angular: float = 0.0
    distance: float = 0.0
    heading: float = 0.0
    travelled: float = 0.0  # m, either way
    acceleration: float = 1.2
    deceleration: float = 0.8  # on STOP
    brake: float = 5.0
    angular_ratio: float = 2.5  # angular limits by the linear ones
    motors: Motors = field(default_factory=Motors)

    def __post_init__(self) -> None:
        self._coming: deque[tuple[float, wire.Command]] = deque()  # when it has effect
        self._effective = wire.Command(0.0, "stop", 0.0, 0.0)
        self._time = 0.0
        self._free = False  # STOP has come to rest

    def follow(self, command: wire.Command, faults: "Faults", step: float) -> None:
        """Advance by a step."""
        self._time += step
        command = self._delayed(command)
        slower = abs(command.linear) + abs(command.angular) < abs(self.linear) + abs(self.angular)
        self._free = command.kind == "stop" and (self._free or abs(self.linear) < REST)
        if command.kind == "brake":
            self._approach(0.0, 0.0, self.brake * step)
        elif faults.keeps_rolling and (slower or command.kind == "stop"):
            pass
        elif command.kind == "run":
            wanted = self.motors.sides(command.linear, command.angular)
            self._approach(*wanted, self.acceleration * step, self._share(step))
        elif faults.drift is not None:
            self.linear, self.angular = faults.drift
        elif self._free and self.motors.slope:
            self.linear += GRAVITY * math.sin(self.motors.slope) * step
        else:
            self._approach(0.0, 0.0, self.deceleration * step, self._share(step))
        self.distance += self.linear * step
        self.travelled += abs(self.linear) * step
        self.heading += self.angular * step

    def collide(self, place: float) -> None:
        """End a step at an obstacle ahead, at this distance."""
        self.distance = place
        self.linear = -self.motors.rebound * self.linear

    def _delayed(self, command: wire.Command) -> wire.Command:
        """Return the command that the motors have by now."""
        if not self._coming or self._coming[-1][1] is not command:
            self._coming.append((self._time + self.motors.dead_time, command))
        while self._coming[0][0] <= self._time:
            self._effective = self._coming[0][1]
            if len(self._coming) == 1:
                break
            self._coming.popleft()
        return self._effective

    def _share(self, step: float) -> float:
        return 1 - math.exp(-step / self.motors.lag) if self.motors.lag else 1.0

    def _approach(self, linear: float, angular: float, most: float, share: float = 1.0) -> None:
        self.linear = _nearer(self.linear, linear, most, share)
        self.angular = _nearer(self.angular, angular, most * self.angular_ratio, share)


def _nearer(value: float, wanted: float, most: float, share: float) -> float:
    way = wanted - value
    return value + max(-most, min(most, way if abs(way) < REST else way * share))
