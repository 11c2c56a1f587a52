"""``python -m verification.fleet.source ENDPOINT ROBOT``: motion requests with varying speed.

The speed identifies the frame at the board that answers a request.
"""

import sys

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import SafetyState
from common.operator import reset_request
from common.source import DriveSource
from verification.fleet.figures import Request
from verification.harness.bus import at
from verification.harness.child_process import serve

PERIOD_S = 0.05
SLOW_MPS, STEP_MPS, STEPS = 0.3, 0.001, 20


class RequestSource:
    """Requests motion 20 times a second; zero and a reset while safety refuses motion."""

    def __init__(self, loop: Loop, bus: Bus) -> None:
        self.requests: list[Request] = []
        self._bus = bus
        self._source = DriveSource(bus, "teleop")
        self._state: SafetyState | None = None
        self._number = 0
        self._refused = 0
        bus.subscribe(keys.SAFETY, self._on_safety)
        loop.every(PERIOD_S, self._request)

    def begin(self) -> None:
        self.requests.clear()
        self._refused = 0

    def end(self) -> object:
        """Return the requests, and how often motion was refused."""
        return {
            "requests": [(a.mono_ns, a.linear) for a in self.requests],
            "refused": self._refused,
        }

    def _request(self, _: int) -> None:
        if self._state is None or self._state.verdict not in ("run", "slow"):
            self._refused += 1
            if self._state is not None and self._state.latched and self._refused % 10 == 0:
                request = reset_request(self._state)
                self._bus.call(keys.RESET, request, lambda _: None, lambda _: None)
            self._source.request(0.0, 0.0)
            return
        self._number += 1
        linear = round(SLOW_MPS + STEP_MPS * (self._number % STEPS), 3)
        drive = self._source.request(linear, 0.0)
        if self._number % STEPS:  # the large step down is ramped
            self.requests.append(Request(drive.mono_ns, linear))

    def _on_safety(self, arrival: Arrival[SafetyState]) -> None:
        self._state = arrival.message


def main() -> None:
    """Drive until standard input ends."""
    endpoint, robot = sys.argv[1:]
    loop = Loop()
    bus = Bus(at(endpoint), robot, loop.post)
    source = RequestSource(loop, bus)
    bus.open()
    serve(lambda: loop.post(source.begin), source.end, loop.stop)
    loop.run()
    bus.close()


if __name__ == "__main__":
    main()
