"""The simulated stack with verbs for scenarios; each lets ``ms`` of time pass at its end."""

from typing import Any, Literal

import pytest

from common.motion import Twist
from common.wire.reports import VelocityReport
from services.ros2.command import SOURCE
from sim import requests as q
from sim.board import Board
from sim.faults import Datagram
from sim.model import Model
from sim.sonar import Ranges
from t2 import keys
from t2 import messages as m
from verification.search.bus import MS, ROBOT, Disturbance
from verification.search.ros import RosSource
from verification.search.stack import Stack

ALL_SONARS = range(8)
NO_ECHO_MM, FAULT_MM, NEAREST_MM = 5000, 0xFFFF, 60
SENSED, SHADES = 5, 5  # steps of 10 ms per sonar reading, readings until one repeats


class OverriddenBoard(Board):
    """A board whose measured speed and ranges may be replaced."""

    measured: Twist | None = None
    ranges: list[int | None] = [None] * 8  # mm
    _steps = 0

    def sense(self, twist: Twist, ranges: Ranges, pressed: bool) -> None:
        self._steps += 1
        pairs = zip(self.ranges, ranges, strict=True)
        super().sense(twist, tuple(self._shown(*pair) for pair in pairs), pressed)

    def velocity(self) -> VelocityReport:
        if self.measured is None:
            return super().velocity()
        return VelocityReport(round(self.measured.linear * 1000), 0)

    def _shown(self, mm: int | None, real: int) -> int:
        if mm is None:
            return real
        # A wall that stays the same to the millimetre would be a stuck sensor.
        noise = self._steps // SENSED % SHADES
        return mm + noise if NEAREST_MM < mm < NO_ECHO_MM else mm


class ScriptedStack(Stack):
    """A vehicle on an empty plane, with two sticks."""

    def __init__(self) -> None:
        super().__init__()
        self.board = OverriddenBoard(Model(), (NO_ECHO_MM,) * 8)
        self.board.ranges = [None] * 8
        self.vehicle.simulation.board = self.board

    def request(
        self, linear: float | None, ms: int = 0, *, angular: float = 0.0, source: str = "teleop"
    ) -> None:
        """Request a motion from now on; None: request nothing, as a source that has died."""
        message = None if linear is None else m.Drive(linear=linear, angular=angular, echo=0)
        self.sources[source].message = message
        self.run(ms)

    def drive(
        self, linear: float, ms: int = 0, *, angular: float = 0.0, source: str = "teleop"
    ) -> None:
        """Ask for zero until inputs have settled, then for motion: the way it is meant."""
        self.request(0.0, 650, source=source)
        self.request(linear, ms, angular=angular, source=source)

    def ros(
        self, pattern: str | None, linear: float = 0.5, ms: int = 0, *, unheard: int = 0
    ) -> None:
        """Start a ROS node that publishes motion as one of the tools; None: end it."""
        node = self.sources[SOURCE]
        assert isinstance(node, RosSource)
        node.start(pattern, linear, unheard)
        self.run(ms)

    def press(self, pressed: bool, ms: int = 0) -> None:
        """Press the bumper, or free it."""
        self.vehicle.inject(q.Bumper(pressed=pressed))
        self.run(ms)

    def measure(self, linear: float | None, ms: int = 0) -> None:
        """Report a measured speed, None: the true one."""
        self.board.measured = None if linear is None else Twist(linear)
        self.run(ms)

    def sonars(self, mm: int | None, ms: int = 0, *, numbers: range = ALL_SONARS) -> None:
        """Report a range, or a fault; None: what is there."""
        for number in numbers:
            self.board.ranges[number] = mm
        self.run(ms)

    def driver(self, bits: int, ms: int = 0, *, side: Literal["left", "right"] = "left") -> None:
        """Report a fault of a motor driver, or its end."""
        self.vehicle.inject(q.Driver(side=side, bits=bits))
        self.run(ms)

    def velocities(self, on: bool, ms: int = 0) -> None:
        """Stop or resume the velocity reports."""
        self.vehicle.inject(q.Mute(reports=() if on else ("velocity",)))
        self.run(ms)

    def freeze(self, ms: int) -> None:
        """Freeze the board for so long."""
        self.vehicle.inject(q.Freeze(seconds=ms / 1000))

    def power_cycle(self, ms: int) -> None:
        """Restart the board, and wait until it is back."""
        self.vehicle.inject(q.PowerCycle(seconds=ms / 1000))
        self.run(ms)

    def send(self, datagram: bytes) -> None:
        """Send any bytes to both ports of the bridge."""
        for port in self.vehicle.ports:
            self.vehicle.simulation.to_pc.put(Datagram(datagram, port), self.net.now_ns)

    def cable(self, wire: q.Wire, ms: int) -> None:
        """Delay, lose or duplicate datagrams for a while."""
        slack_ms = wire.delay * 1000 + (150 if wire.drop else 0)
        self.oracle.slack_ns = max(self.oracle.slack_ns, round(slack_ms * MS))
        self.vehicle.inject(wire)
        self.run(ms)

    def switches(self, *, on: bool) -> bool:
        """Ask the bridge to set the board's bumper brake."""
        echo = self.seen.heartbeat if self.seen else None
        request = m.SwitchesRequest(bumper_brake=on, echo=echo)
        with self.time():
            return self.processes["bridge"].call(keys.SET_SWITCHES, request).done is not False

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

    def silence(self, source: str, ms: int = 0) -> None:
        """Silence a source from now on."""
        self.sources[source].message = None
        self.run(ms)

    def limit(
        self, linear: float | None, ms: int = 0, *, angular: float | None = None, source: str
    ) -> None:
        """Limit the speed from now on; None leaves an axis unlimited."""
        self.sources[source].message = m.Limit(linear=linear, angular=angular, echo=0)
        self.run(ms)

    def disturb(self, route: str, disturbance: Disturbance, ms: int = 0) -> None:
        """Delay, lose, duplicate or reorder the messages of a route."""
        self.net.disturbances[route] = disturbance
        self.run(ms)

    def creep(self, direction: m.Direction = "backward", times: int = 10) -> None:
        """Hold the release for a while, between neutral requests; then request nothing."""
        self.request(0.0, 60)
        self.hold(direction, 60 * times)
        self.request(0.0, 60)
        self.request(None)

    def hold(self, direction: m.Direction, ms: int = 0, *, source: str = "teleop") -> None:
        """Request the release from now on."""
        message = m.Drive(linear=0.0, angular=0.0, release=direction, echo=0)
        self.sources[source].message = message
        self.run(ms)

    def put_release(self, direction: m.ReleaseRequest, echo: int) -> None:
        """Put one request of teleop with this echo."""
        drive = m.Drive(linear=0.0, angular=0.0, release=direction, echo=echo)
        self.sources["teleop"].put(drive)

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
