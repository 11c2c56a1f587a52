"""Log of the messages since the last mark, each with its local receive time."""

import time
from collections.abc import Callable
from typing import Any

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.freshness import Latest

DEPTH = 64  # more than arrives between two rounds of the loop
PAYLOAD_OFFSET = 8  # of a frame


class MessageLog:
    """Records every message that the checkout needs; runs in the loop's thread."""

    def __init__(self, bus: Bus) -> None:
        self.links: list[Latest[m.Link]] = []
        self.safety: list[Latest[m.SafetyState]] = []
        self.motions: list[Latest[m.Motion]] = []
        self.velocities: list[Latest[m.Velocity]] = []
        self.mileages: list[Latest[m.Mileage]] = []
        self.ultrasonics: list[Latest[m.Ultrasonic]] = []
        self.bumpers: list[Latest[m.Bumper]] = []
        self.drivers: list[Latest[m.Driver]] = []  # motor drivers
        self.switches: list[Latest[m.Switches]] = []
        self.health: list[Latest[m.Health]] = []
        self.frames = 0  # received with the board's bytes
        self.nonzero = 0  # of these, with a payload that is not all zeros
        self._marked_ns = 0
        self._lists: list[list[Any]] = []
        for topic, log in (
            (keys.LINK, self.links),
            (keys.SAFETY, self.safety),
            (keys.MOTION, self.motions),
            (keys.VELOCITY, self.velocities),
            (keys.MILEAGE, self.mileages),
            (keys.ULTRASONIC, self.ultrasonics),
            (keys.BUMPER, self.bumpers),
            (keys.SWITCHES, self.switches),
        ):
            bus.subscribe(topic, self._into(log), depth=DEPTH)
        bus.subscribe(keys.DRIVER, self._into(self.drivers), depth=DEPTH, side="*")
        bus.subscribe(keys.HEALTH, self._into(self.health), depth=DEPTH, service="*")

    def mark(self) -> int:
        """Discard everything received until now, queued messages too; return the time."""
        self._marked_ns = time.monotonic_ns()
        for log in self._lists:
            log.clear()
        self.frames = self.nonzero = 0
        return self._marked_ns

    def _into(self, log: list[Latest[Any]]) -> Callable[[Arrival[Any]], None]:
        self._lists.append(log)

        def take(arrival: Arrival[Any]) -> None:
            if arrival.received_ns < self._marked_ns:
                return
            log.append(Latest(arrival.message, arrival.received_ns))
            if arrival.raw:
                self.frames += 1
                self.nonzero += any(arrival.raw[PAYLOAD_OFFSET:])

        return take
