"""``python -m bench.client ENDPOINT reset | MODE ROBOT [SETTING]...``: a robot's clients.

``reset`` is an operator that resets every latch. ``drive`` requests motion like teleop, with a
speed that identifies the frame at the board that answers. It is a child process that
also executes ``estop``, repeated until ``go``, which requests again. ``pictures`` turns on the
spot, receives all pictures of the cameras and counts them.
"""

import sys
import time
from collections.abc import Sequence
from functools import partial

from bench.child_process import serve
from common.bus.bus import Arrival, Bus
from common.config import Sources, load
from common.loop import Loop
from common.settings import BusSettings, Shared
from common.source import DriveSource
from t2 import keys
from t2 import messages as m
from t2.client import reset_request

SLOW_MPS, STEP_MPS, STEPS = 0.3, 0.001, 20
TURN_RADPS = 0.4
PERIOD_S, RESET_TICKS = 0.05, 10


class Resetter:
    """Calls reset, one call at a time, while anything is latched."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._pending = False
        self._state: m.SafetyState | None = None
        bus.subscribe(keys.SAFETY, self._on_state)
        bus.subscribe(keys.MOTION, self._on_motion)  # more frequent than the state

    def _on_state(self, arrival: Arrival[m.SafetyState]) -> None:
        self._state = arrival.message

    def _on_motion(self, arrival: Arrival[m.Motion]) -> None:
        state = self._state
        if arrival.message.latched and state is not None and state.latched and not self._pending:
            self._pending = True
            self._bus.call(keys.RESET, reset_request(state), self._answered, self._answered, 1.0)

    def _answered(self, _: object) -> None:
        self._pending = False


class Driver:
    """Requests motion 20 times a second; neutral and a reset while safety refuses motion."""

    def __init__(self, loop: Loop, bus: Bus) -> None:
        self._bus = bus
        self._source = DriveSource(bus, "teleop")
        self._state: m.SafetyState | None = None
        self._number = self._refusals = 0
        self._stops = self._turns = self._always_turns = False
        self.begin()
        bus.subscribe(keys.SAFETY, self._on_safety)
        loop.every(PERIOD_S, self._request)

    def receive_pictures(self) -> None:
        """Turn on the spot, and receive the pictures of all cameras."""
        self._always_turns = True
        self._bus.subscribe(keys.PICTURE, self._on_picture, camera="*")

    def begin(self) -> None:
        """Forget the requests and the pictures."""
        self._began_s, self._sizes = time.monotonic(), list[int]()
        self.requests: list[tuple[int, float]] = []

    def pictures(self) -> dict[str, list[float]]:
        """Return the pictures a second and their sizes in bytes."""
        rate = len(self._sizes) / (time.monotonic() - self._began_s)
        return {"pictures": [rate], "size": [float(size) for size in self._sizes]}

    def execute(self, word: str) -> None:
        """Execute ``estop``, which is repeated, ``turn`` on the spot, or ``go``."""
        self._stops, self._turns = word == "estop", word == "turn" or self._always_turns
        if self._stops:
            self._bus.estop()

    def _request(self, _: int) -> None:
        state = self._state
        if self._stops or state is None or state.verdict not in ("run", "slow"):
            self._source.request(0.0, 0.0)
            self._refusals += 1
            if self._stops:
                self._bus.estop()
            elif state and state.latched and self._refusals % RESET_TICKS == 0:
                request = reset_request(state)
                self._bus.call(keys.RESET, request, lambda _: None, lambda _: None)
            return
        if self._turns:
            self._source.request(0.0, TURN_RADPS)
            return
        self._number += 1
        linear = round(SLOW_MPS + STEP_MPS * (self._number % STEPS), 3)
        drive = self._source.request(linear, 0.0)
        if self._number % STEPS:  # the large step down is ramped
            self.requests.append((drive.mono_ns, linear))

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._state = arrival.message

    def _on_picture(self, arrival: Arrival[m.Picture]) -> None:
        self._sizes.append(len(arrival.message.jpeg))


def drive(endpoint: str, mode: str, robot: str, sets: Sequence[str]) -> None:
    """Drive until standard input ends."""
    config = load(Shared, Sources(sets=[f"bus.connect={endpoint}", *sets])).config
    loop = Loop()
    bus = Bus(config.bus, robot, loop.post)
    driver = Driver(loop, bus)
    if mode == "pictures":
        driver.receive_pictures()
    bus.open()

    serve(
        driver.begin,
        driver.pictures if mode == "pictures" else lambda: driver.requests,
        loop.stop,
        lambda word: loop.post(partial(driver.execute, word)),
    )
    loop.run()
    bus.close()


def reset(endpoint: str) -> None:
    """Reset until killed."""
    loop = Loop()
    bus = Bus(BusSettings(connect=(endpoint,)), "001", loop.post)
    Resetter(bus)
    bus.open()
    loop.run()


if __name__ == "__main__":
    match sys.argv[1:]:
        case [endpoint, "reset"]:
            reset(endpoint)
        case [endpoint, ("drive" | "pictures") as mode, robot, *sets]:
            drive(endpoint, mode, robot, sets)
