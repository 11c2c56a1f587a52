"""The simulated stack with verbs for scenarios; each lets ``ms`` of time pass at its end."""

from typing import Any

import pytest

from common import keys
from common import messages as m
from common.motion import Twist
from common.wire.frame import Side
from sim import requests as q
from verification.search.bus import ROBOT, Disturbance
from verification.search.sources import Limiter, Pendant
from verification.search.stack import Stack

ALL_SONARS = range(8)


class ScriptedStack(Stack):
    """A vehicle on an empty plane, with two sticks."""

    def request(
        self, linear: float | None, ms: int = 0, *, angular: float = 0.0, source: str = "teleop"
    ) -> None:
        """Request a motion from now on; None: request nothing, as a source that has died."""
        self.sticks[source].requested = None if linear is None else (linear, angular)
        self.run(ms)

    def drive(
        self, linear: float, ms: int = 0, *, angular: float = 0.0, source: str = "teleop"
    ) -> None:
        """Ask for zero until inputs have settled, then for motion: the way it is meant."""
        self.request(0.0, 650, source=source)
        self.request(linear, ms, angular=angular, source=source)

    def press(self, pressed: bool, ms: int = 0) -> None:
        """Press the bumper, or free it."""
        self.vehicle.pressed = pressed
        self.run(ms)

    def measure(self, linear: float | None, ms: int = 0) -> None:
        """Report a measured speed, None: the true one."""
        self.vehicle.board.measured = None if linear is None else Twist(linear)
        self.run(ms)

    def sonars(self, mm: int | None, ms: int = 0, *, numbers: range = ALL_SONARS) -> None:
        """Report a range, or a fault; None: what is there."""
        for number in numbers:
            self.vehicle.board.ranges[number] = mm
        self.run(ms)

    def driver(self, bits: int, ms: int = 0, *, side: Side = Side.LEFT) -> None:
        """Report a fault of a motor driver, or its end."""
        self.vehicle.fault(side, bits)
        self.run(ms)

    def velocities(self, on: bool, ms: int = 0) -> None:
        """Stop or resume the velocity reports."""
        self.vehicle.inject(q.Mute(reports=() if on else ("velocity",)))
        self.run(ms)

    def freeze(self, ms: int) -> None:
        """Freeze the board for so long."""
        self.vehicle.freeze(ms)

    def garbage(self, garbage: bytes) -> None:
        """Send the bridge bytes that begin as a frame does."""
        self.vehicle.send(b"GS" + garbage)

    def stop(self, ms: int = 5) -> None:
        """Press the emergency stop."""
        self.estop()
        self.run(ms)

    def outage(self, ms: int) -> None:
        """Take the router away for a while."""
        self.router(False)
        self.run(ms)
        self.router(True)
        self.run(5)

    def silence(self, source: Limiter | Pendant) -> None:
        """Silence a source from now on."""
        if isinstance(source, Limiter):
            source.caps = None
        else:
            source.alive = False

    def limit(
        self, linear: float | None, ms: int = 0, *, angular: float | None = None, source: str
    ) -> None:
        """Limit the speed from now on."""
        self.limiters[source].caps = linear, angular
        self.run(ms)

    def disturb(self, route: str, disturbance: Disturbance, ms: int = 0) -> None:
        """Delay, lose, duplicate or reorder the messages of a route."""
        self.net.disturbances[route] = disturbance
        self.run(ms)

    def creep(self, direction: m.Direction = "backward", times: int = 10) -> None:
        """Hold the release for a while."""
        for _ in range(times):
            self.hold(True, direction)
            self.run(60)

    def trip(self, kind: str) -> None:
        """Trip a latch whose cause ends at once."""
        if kind == "estop":
            self.stop()
        elif kind == "bumper":
            self.press(True, 60)
            self.press(False)
        elif kind == "driver":
            self.driver(1 << 31, 60)
            self.driver(0)
        elif kind == "router":
            self.outage(60)
        else:
            self.measure(1.5, 700)
            self.measure(None)

    def forge(self, topic: keys.Topic[Any], message: m.Message) -> None:
        """Put a message as a client of the router."""
        self.hand.post(topic.on(ROBOT), message)


def driving() -> ScriptedStack:
    """Return a stack that drives on request of teleop."""
    stack = ScriptedStack()
    stack.run(700)
    stack.request(0.0, 700)
    stack.request(0.5, 1500)
    assert stack.vehicle.simulation.twist.linear == pytest.approx(0.5, abs=0.05)
    return stack
