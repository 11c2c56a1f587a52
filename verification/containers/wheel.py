"""A driver on this machine, who comes in over TLS as a laptop does."""

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

SPEED = 0.3  # m/s that is asked for
MOVING = 0.1  # m/s, by what is really driven
LAP_S = 180.0  # a lap takes a third of that


class Wheel:
    """Asks 20 times a second: for what the lap wants while one is driven, else for ``linear``."""

    def __init__(self, where: settings.BusSettings, robot: str, loop: Loop) -> None:
        self.linear = 0.0  # m/s
        self.bus = Bus(where, robot, loop.post)
        self.driver = Driver(self.bus, Lap(()), lambda _: None)
        self._loop = loop
        self._stick = DriveSource(self.bus, "teleop")
        self._lap: Lap | None = None

    @property
    def safety(self) -> m.SafetyState | None:
        """What safety said last."""
        return self.driver.safety

    def beat(self, now_ns: int) -> None:
        """Ask; in the loop's thread."""
        if self._lap is not None:
            self.driver.on_beat(now_ns)
        else:
            del self.driver.odometry[:-1]
            self._stick.ask(self.linear, 0.0)

    def drive_lap(self, pace: Pace) -> Sequence[m.Odometry]:
        """Drive a lap to its end, and return what odometry told on the way."""
        self._lap = self.driver.lap = whole = Lap(lap(fast=False, pace=pace))
        try:
            wait_until(lambda: whole.step is None, "the lap is driven", LAP_S)
            return list(self.driver.odometry)
        finally:
            self._lap = None

    def push(self, speed: Callable[[], float]) -> None:
        """Drive on until the vehicle moves; center the stick first when safety wants a neutral."""
        for _ in range(20):
            self.linear = 0.0
            self._clear()
            self.linear = SPEED
            end_s = time.monotonic() + 3.0
            while time.monotonic() < end_s:
                if abs(speed()) > MOVING:
                    return
                time.sleep(0.01)
        raise AssertionError(f"it does not drive: {self.safety.text if self.safety else 'silence'}")

    def _clear(self) -> None:
        """Reset what is latched, and wait until safety would let it move."""
        end_s = time.monotonic() + 20.0
        while time.monotonic() < end_s:
            state = self.safety
            if state is not None and state.latched:
                self._loop.post(self._reset)
            elif state is not None and state.verdict in ("run", "slow"):
                return
            time.sleep(0.2)

    def _reset(self) -> None:
        # Refused or not, safety's state tells.
        if self.safety is not None:
            request = reset_request(self.safety)
            self.bus.ask(keys.RESET, request, lambda _: None, lambda _: None)


@contextmanager
def wheel(where: settings.BusSettings, robot: str) -> Iterator[Wheel]:
    """Sit at the wheel while the context lasts."""
    with running(Loop()) as loop:
        made = Wheel(where, robot, loop)
        made.bus.open()
        loop.post(lambda: loop.every(PERIOD_S, made.beat))
        try:
            wait_until(lambda: made.safety is not None, "safety is heard over TLS", 60.0)
            yield made
        finally:
            loop.post(made.bus.close)
