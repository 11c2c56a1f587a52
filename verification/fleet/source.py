"""``python -m verification.fleet.source ENDPOINT ROBOT``: requests, each with another speed.

So the frame at the board that answers a request is known by its speed.
"""

import sys

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import SafetyState
from common.operator import reset_request
from common.source import DriveSource
from verification.fleet.child_process import obey
from verification.fleet.figures import Asked
from verification.harness.bus import at

PERIOD_S = 0.05
SLOW_MPS, STEP_MPS, STEPS = 0.3, 0.001, 20


class Hand:
    """Asks 20 times a second; with zeros, and for a reset, while safety will not have it."""

    def __init__(self, loop: Loop, bus: Bus) -> None:
        self.asked: list[Asked] = []
        self._bus = bus
        self._source = DriveSource(bus, "teleop")
        self._state: SafetyState | None = None
        self._number = 0
        self._refused = 0
        bus.subscribe(keys.SAFETY, self._hear)
        loop.every(PERIOD_S, self._ask)

    def begin(self) -> None:
        self.asked.clear()
        self._refused = 0

    def end(self) -> object:
        """Tell what was asked, and how often it could not be."""
        return {"asked": [(a.mono_ns, a.linear) for a in self.asked], "refused": self._refused}

    def _ask(self, _: int) -> None:
        if self._state is None or self._state.verdict not in ("run", "slow"):
            self._refused += 1
            if self._state is not None and self._state.latched and self._refused % 10 == 0:
                request = reset_request(self._state)
                self._bus.ask(keys.RESET, request, lambda _: None, lambda _: None)
            self._source.ask(0.0, 0.0)
            return
        self._number += 1
        linear = round(SLOW_MPS + STEP_MPS * (self._number % STEPS), 3)
        drive = self._source.ask(linear, 0.0)
        if self._number % STEPS:  # the step down takes its time
            self.asked.append(Asked(drive.mono_ns, linear))

    def _hear(self, arrival: Arrival[SafetyState]) -> None:
        self._state = arrival.message


def main() -> None:
    """Drive until standard input ends."""
    endpoint, robot = sys.argv[1:]
    loop = Loop()
    bus = Bus(at(endpoint), robot, loop.post)
    hand = Hand(loop, bus)
    bus.open()
    obey(lambda: loop.post(hand.begin), hand.end, loop.stop)
    loop.run()
    bus.close()


if __name__ == "__main__":
    main()
