"""A driver that connects over TLS like a laptop."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import t2
from cli.demo.driver import Driver
from cli.demo.lap import Pace, drive_lap
from cli.demo.record import LapRecord
from common import keys, settings
from common import messages as m
from common.bus.bus import Bus
from common.loop import Loop
from common.operator import reset_request
from common.source import DriveSource
from verification.harness.bus import running
from verification.harness.waiting import wait_until

SPEED = 0.3  # m/s, requested
PERIOD_S = 0.05
MOVING = 0.1  # m/s, true speed
LAP_S = 180.0  # a lap takes a third of that


class LaptopDriver:
    """Requests ``linear`` 20 times a second, except while a lap is driven."""

    def __init__(self, where: settings.BusSettings, robot: str, loop: Loop) -> None:
        self.linear = 0.0  # m/s
        self.bus = Bus(where, robot, loop.post)
        self.safety: m.SafetyState | None = None
        self.odometry: m.Odometry | None = None
        self.bus.subscribe(keys.SAFETY, lambda a: setattr(self, "safety", a.message))
        self.bus.subscribe(keys.ODOMETRY, lambda a: setattr(self, "odometry", a.message))
        self._where = where
        self._loop = loop
        self._source = DriveSource(self.bus, "teleop")
        self._in_lap = False

    def beat(self, _: int) -> None:
        """Send a request; in the loop's thread."""
        if not self._in_lap:
            self._source.request(self.linear, 0.0)

    def drive_lap(self, pace: Pace) -> LapRecord:
        """Drive a lap to its end, with the settings that ``t2 keys`` wrote."""
        self._in_lap = True
        record, ended = LapRecord(), threading.Event()
        timeout = threading.Timer(LAP_S, ended.set)
        timeout.start()
        try:
            folder = Path(self._where.certificate).parent
            with t2.connect(
                self.bus.robot, endpoint=self._where.endpoints[0], config=folder / "bus.toml"
            ) as robot:
                record.subscribe(robot)
                drive_lap(Driver(robot, record, ended), pace)
                record.finished = True
            return record
        finally:
            timeout.cancel()
            self._in_lap = False

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
