"""Driver of the lap: an ordinary consumer of the bus and a source of drive requests."""

from collections.abc import Callable
from typing import Any

from cli.demo.script import Action, Lap, Press, Step, View
from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.freshness import NS_PER_S
from common.motion import STILL
from common.operator import release_request, reset_request
from common.source import DriveSource

PERIOD_S = 0.05
PRESS_NS = round(0.15 * NS_PER_S)  # between two calls; a held release expires after 0.3 s


class Driver:
    """Drives a lap over the bus; runs in the loop's thread."""

    def __init__(self, bus: Bus, lap: Lap, on_step: Callable[[Step], None]) -> None:
        self.lap = lap
        self.odometry: list[m.Odometry] = []
        self.ranges: m.Ultrasonic | None = None
        self.velocity: m.Velocity | None = None
        self.safety: m.SafetyState | None = None
        self.link: m.Link | None = None
        self.requested = STILL
        self.answers: list[tuple[str, Press, bool, str]] = []  # step, call, granted, text
        self._pressed = False
        self._bus = bus
        self._source = DriveSource(bus, "demo")
        self._on_step = on_step
        self._announced = -1
        self._refusal: str | None = None
        self._granted = False
        self._pressed_ns = 0
        self._listen()

    def on_beat(self, now_ns: int) -> None:
        """Decide and send a drive request, at 20 Hz."""
        if self.safety is None or not self.odometry:
            return
        view = View(self.odometry[-1], self.safety, self._pressed, self._refusal, self._granted)
        action = self.lap.advance(view, now_ns)
        self._announce()
        self._source.request(action.twist.linear, action.twist.angular)
        self.requested = action.twist
        self._press(action, self.safety, now_ns)

    def _listen(self) -> None:
        def keep(name: str) -> Callable[[Arrival[Any]], None]:
            return lambda arrival: setattr(self, name, arrival.message)

        self._bus.subscribe(keys.SAFETY, keep("safety"))
        self._bus.subscribe(keys.ULTRASONIC, keep("ranges"))
        self._bus.subscribe(keys.VELOCITY, keep("velocity"))
        self._bus.subscribe(keys.LINK, keep("link"))
        self._bus.subscribe(keys.ODOMETRY, lambda a: self.odometry.append(a.message), depth=64)
        self._bus.subscribe(keys.BUMPER, lambda a: setattr(self, "_pressed", a.message.pressed))

    def _announce(self) -> None:
        if self.lap.index != self._announced:
            self._announced = self.lap.index
            self._refusal, self._granted, self._pressed_ns = None, False, 0
            if self.lap.step is not None:
                self._on_step(self.lap.step)

    def _press(self, action: Action, seen: m.SafetyState, now_ns: int) -> None:
        if action.press is None or now_ns - self._pressed_ns < PRESS_NS:
            return
        self._pressed_ns = now_ns
        press, index = action.press, self.lap.index

        def answer(granted: bool, text: str) -> None:
            step = self.lap.steps[index]
            known = (step.name, press, granted, text)
            if not self.answers or self.answers[-1] != known:
                self.answers.append(known)
            if index == self.lap.index:
                self._granted, self._refusal = granted, None if granted else text

        def done(reply: m.Done) -> None:
            answer(True, reply.text)

        def refused(reason: str) -> None:
            answer(False, reason)

        if press == "reset":
            self._bus.call(keys.RESET, reset_request(seen), done, refused)
        else:  # the lap hits its box while driving forward
            request = release_request(seen, "backward", held=True)
            self._bus.call(keys.RELEASE, request, done, refused)
