"""The simulated main board: state, answers, and the effect of the current command.

It holds the last motion command indefinitely: no watchdog is documented; ``firmware.watchdog`` is
one. It has two emergency brakes, off at power-on, which override that command. The real behaviour
is unknown; here it is:

=================== ===============================================================================
brake               while active, the board does BRAKE instead of the command
=================== ===============================================================================
ultrasonic (0x7603) a sonar in the direction of motion, measured or commanded, is nearer than the
                    brake range, or too near to measure
bumper (0x7604)     the bumper is pressed, except for a RUN that backs off, against the direction
                    in which the vehicle last moved when it was pressed
=================== ===============================================================================

A faulty sonar brakes nothing. A motion command has no answer: the velocity is sent continuously
(manual 2.2).
"""

import math
import random

from common.freshness import NS_PER_S
from common.motion import Twist
from common.wire import commands as c
from common.wire import reports as r
from common.wire.frame import Frame, Side
from sim.model import Model
from sim.sonar import Ranges

# rad/s of one unit on the wire.
RADIANS = {"decidegree": math.radians(0.1), "milliradian": 0.001}
FORWARD_SONARS, BACKWARD_SONARS = (1, 2, 3), (5, 6, 7)
S32_SPAN = 2**32
# Closer than safety's margin of 0.20 m: the sonar brake is the second line of defence.
BRAKE_RANGE_MM = 150
ROLLING = 0.005  # m/s, slower counts as standing
EVEN = 0.5  # chance that a bouncing switch is closed

STOP = c.MotionCommand(c.MotionKind.STOP)
BREAK = c.MotionCommand(c.MotionKind.BREAK)


class Switch:
    """The contact of the bumper strip, which may bounce.

    bounce: s after each press and release in which it opens and closes at random; the first reading
    after a change is correct.
    """

    def __init__(self, bounce: float, seed: int) -> None:
        self._bounce_ns = round(bounce * NS_PER_S)
        self._random = random.Random(f"bumper {seed}")
        self._touched = False
        self._until_ns = 0
        self.closed = False

    def touch(self, touched: bool, now_ns: int) -> None:
        """Set whether something presses the strip now."""
        if touched != self._touched:
            self._touched, self._until_ns = touched, now_ns + self._bounce_ns
            self.closed = touched
        elif now_ns < self._until_ns:
            self.closed = self._random.random() < EVEN
        else:
            self.closed = touched


class Board:
    """State since power-on; ``sense`` sets the sensor values."""

    def __init__(self, model: Model, ranges: Ranges, seed: int = 1) -> None:
        self._command_unit = RADIANS[model.wire.command_angular_unit]
        self._feedback_unit = RADIANS[model.wire.feedback_angular_unit]
        self._model = model
        self._random = random.Random(f"velocity {seed}")
        self._slips = random.Random(f"counters {seed}")
        self._twist = Twist()
        self._ranges = ranges
        self.pressed = False
        self._last_way = 0  # sign of the last motion, 0 when there was none
        self._pressed_way = 0  # the same when the bumper was pressed
        self.power_on()

    def power_on(self) -> None:
        """Reset counters, switches, command and driver faults."""
        self.command = STOP
        self.ultrasonic_brake = self.bumper_brake = False
        self.driver_bits = {Side.LEFT: 0, Side.RIGHT: 0}
        self._distance = self._turn = 0.0

    def sense(self, twist: Twist, ranges: Ranges, pressed: bool) -> None:
        """Set the sensor values."""
        self._twist, self._ranges = twist, ranges
        if pressed and not self.pressed:
            self._pressed_way = self._last_way
        self.pressed = pressed
        self._last_way = _sign(twist.linear) or self._last_way

    def count(self, distance: float, turn: float) -> None:
        """Add a true distance (m) and turn (rad) to the counters, with their errors."""
        error = self._model.counters
        self._distance += distance * (1 + error.scale)
        self._turn += turn * (1 + error.turn_scale) + distance * error.pull
        # A random walk: the deviation of a step is that of a unit times the root of its length.
        if error.noise:
            self._distance += self._slips.gauss(0.0, error.noise * math.sqrt(abs(distance)))
        if error.turn_noise:
            self._turn += self._slips.gauss(0.0, error.turn_noise * math.sqrt(abs(turn)))

    def target(self, command: c.MotionCommand) -> Twist:
        """Return the velocity of a command, in SI."""
        return Twist(command.linear_mmps / 1000, command.angular_raw * self._command_unit)

    def drive(self) -> c.MotionCommand:
        """Return the command to the motors: the last one received, or BRAKE."""
        return BREAK if self.braking() else self.command

    def braking(self) -> bool:
        """Return whether one of the emergency brakes is active."""
        return (self.ultrasonic_brake and self._near()) or (self.bumper_brake and self._hit())

    def answer(self, frame: Frame) -> Frame | None:
        """Process a frame and return its answer; a motion command has none."""
        if isinstance(frame, c.MotionCommand):
            self.command = frame
            return None
        if isinstance(frame, c.UltrasonicBrakeSet | c.BumperBrakeSet | c.LedSet):
            return self._set(frame)
        return self._report(frame)

    def velocity(self) -> r.VelocityReport:
        """Return the continuous velocity report."""
        error = self._model.velocity
        linear = self._twist.linear + error.bias + self._noise(error.noise)
        angular = self._twist.angular + error.angular_bias + self._noise(error.angular_noise)
        return r.VelocityReport(round(linear * 1000), round(angular / self._feedback_unit))

    def driver(self, side: Side) -> r.DriverReport:
        """Return a driver report, sent on a query and on a fault."""
        return r.DriverReport(side, self.driver_bits[side])

    def _noise(self, deviation: float) -> float:
        return self._random.gauss(0.0, deviation) if deviation else 0.0

    def _set(self, frame: c.UltrasonicBrakeSet | c.BumperBrakeSet | c.LedSet) -> Frame:
        if isinstance(frame, c.UltrasonicBrakeSet):
            self.ultrasonic_brake = frame.on
            return r.UltrasonicBrakeReport(frame.on)
        if isinstance(frame, c.BumperBrakeSet):
            self.bumper_brake = frame.on
            return r.BumperBrakeReport(frame.on)
        return r.LedReport(True)

    def _report(self, frame: Frame) -> Frame:
        if isinstance(frame, c.DistanceQuery):
            return self._counters()
        if isinstance(frame, c.UltrasonicQuery):
            return r.UltrasonicReport(self._ranges)
        if isinstance(frame, c.DriverQuery):
            return self.driver(frame.side)
        return r.BumperReport(self.pressed)

    def _counters(self) -> r.DistanceReport:
        distance = round(self._distance * 1000)
        return r.DistanceReport(
            (distance + S32_SPAN // 2) % S32_SPAN - S32_SPAN // 2,
            round(math.degrees(math.remainder(self._turn, math.tau)) * 10),
        )

    def _ways(self) -> set[int]:
        """Return the directions of motion, measured and commanded: 1 forward, -1 backward."""
        commanded = self.command.linear_mmps if self.command.kind is c.MotionKind.RUN else 0
        return {_sign(self._twist.linear), _sign(commanded / 1000)} - {0}

    def _near(self) -> bool:
        watched = [
            index
            for way, sonars in ((1, FORWARD_SONARS), (-1, BACKWARD_SONARS))
            if way in self._ways()
            for index in sonars
        ]
        return any(self._ranges[index] < BRAKE_RANGE_MM for index in watched)

    def _hit(self) -> bool:
        backs_off = self._pressed_way != 0 and self._ways() == {-self._pressed_way}
        return self.pressed and not backs_off


def _sign(linear: float) -> int:
    return 0 if abs(linear) < ROLLING else int(math.copysign(1, linear))
