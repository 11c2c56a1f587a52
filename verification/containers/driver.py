"""A driver that connects over TLS like a laptop."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from cli.demo.driver import PERIOD_S, Driver
from cli.demo.script import Lap, Pace, lap
from common import keys, settings
from common import messages as m
from common.bus.bus import Bus
from common.loop import Loop
from common.operator import reset_request
from common.source import DriveSource
from verification.harness.bus import running
from verification.harness.waiting import wait_until

SPEED = 0.3  # m/s, requested
MOVING = 0.1  # m/s, true speed
LAP_S = 180.0  # a lap takes a third of that


class LaptopDriver:
    """Requests motion 20 times a second: the lap's while one is driven, else ``linear``."""

    def __init__(self, where: settings.BusSettings, robot: str, loop: Loop) -> None:
        self.linear = 0.0  # m/s
        self.bus = Bus(where, robot, loop.post)
        self.lap_driver = Driver(self.bus, Lap(()), lambda _: None)
        self._loop = loop
        self._source = DriveSource(self.bus, "teleop")
        self._lap: Lap | None = None

    @property
    def safety(self) -> m.SafetyState | None:
        """The last safety state."""
        return self.lap_driver.safety

    def beat(self, now_ns: int) -> None:
        """Send a request; in the loop's thread."""
        if self._lap is not None:
            self.lap_driver.on_beat(now_ns)
        else:
            del self.lap_driver.odometry[:-1]
            self._source.request(self.linear, 0.0)

    def drive_lap(self, pace: Pace) -> Sequence[m.Odometry]:
        """Drive a lap to its end; return its odometry."""
        self._lap = self.lap_driver.lap = whole = Lap(lap(fast=False, pace=pace))
        try:
            wait_until(lambda: whole.step is None, "the lap is driven", LAP_S)
            return list(self.lap_driver.odometry)
        finally:
            self._lap = None

    def push(self, speed: Callable[[], float]) -> None:
        """Request motion until the vehicle moves, after zero when safety requires neutral."""
        for _ in range(20):
            self.linear = 0.0
            self._clear()
            self.linear = SPEED
            end_s = time.monotonic() + 3.0
            while time.monotonic() < end_s:
                if abs(speed()) > MOVING:
                    return
                time.sleep(0.01)
        raise AssertionError(
            f"does not drive: {self.safety.text if self.safety else 'no safety state'}"
        )

    def _clear(self) -> None:
        """Reset latches, and wait until safety permits motion."""
        end_s = time.monotonic() + 20.0
        while time.monotonic() < end_s:
            state = self.safety
            if state is not None and state.latched:
                self._loop.post(self._reset)
            elif state is not None and state.verdict in ("run", "slow"):
                return
            time.sleep(0.2)

    def _reset(self) -> None:
        # The safety state shows the result.
        if self.safety is not None:
            request = reset_request(self.safety)
            self.bus.call(keys.RESET, request, lambda _: None, lambda _: None)


@contextmanager
def driving(where: settings.BusSettings, robot: str) -> Iterator[LaptopDriver]:
    """Connect the driver."""
    with running(Loop()) as loop:
        made = LaptopDriver(where, robot, loop)
        made.bus.open()
        loop.post(lambda: loop.every(PERIOD_S, made.beat))
        try:
            wait_until(lambda: made.safety is not None, "a safety state over TLS", 60.0)
            yield made
        finally:
            loop.post(made.bus.close)
