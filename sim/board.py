"""The main board: what it knows, what it answers, and what it makes of the command that it holds.

It holds the last motion command for ever: no watchdog is documented. Two emergency brakes of its
own, off at power-on, overrule that command; how the real ones work is unknown, these do this:

=================== ===============================================================================
brake               while it acts, the board does BREAK instead of the command
=================== ===============================================================================
ultrasonic (0x7603) a sonar in the direction of motion, measured or commanded, is nearer than the
                    brake range, too near to measure included
bumper (0x7604)     the bumper is pressed; but ``toward`` lets a RUN pass that backs off, against
                    the direction in which the vehicle last moved when it was pressed
=================== ===============================================================================

A faulty sonar brakes nothing. A motion command has no answer of its own: the velocity comes anyway,
all the time (manual 2.2).
"""

import math

from common.motion import Twist
from common.settings import Wire
from common.wire import commands as c
from common.wire import reports as r
from common.wire.frame import Frame, Side
from sim.config import Sim
from sim.geometry import wrapped
from sim.sonar import Ranges

# rad/s for one unit of the wire; which unit it is each way, is a setting.
RADIANS = {"decidegree": math.radians(0.1), "milliradian": 0.001}
DRIVER_SIDES = {"left": Side.LEFT, "right": Side.RIGHT}
FORWARD_SONARS, BACKWARD_SONARS = (1, 2, 3), (5, 6, 7)
S32_SPAN = 2**32
ROLLING = 0.005  # m/s, slower counts as standing

STOP = c.MotionCommand(c.MotionKind.STOP)
BREAK = c.MotionCommand(c.MotionKind.BREAK)


class Board:
    """State since power-on; ``sense`` tells it what its sensors see."""

    def __init__(self, wire: Wire, settings: Sim, ranges: Ranges) -> None:
        self._command_unit = RADIANS[wire.command_angular_unit]
        self._feedback_unit = RADIANS[wire.feedback_angular_unit]
        self._settings = settings
        self._twist = Twist()
        self._ranges = ranges
        self.pressed = False
        self._last_way = 0  # sign of the last motion, 0 when there was none
        self._pressed_way = 0  # the same when the bumper was pressed
        self.power_on()

    def power_on(self) -> None:
        """Start anew: counters, switches, command, lamps and driver faults."""
        self.command = STOP
        self.ultrasonic_brake = self.bumper_brake = False
        self.driver_bits = {Side.LEFT: 0, Side.RIGHT: 0}
        self.lamps: dict[int, c.LedSet] = {}
        self._distance = self._turn = 0.0

    def sense(self, twist: Twist, ranges: Ranges, pressed: bool) -> None:
        """Take what the sensors say."""
        self._twist, self._ranges = twist, ranges
        if pressed and not self.pressed:
            self._pressed_way = self._last_way
        self.pressed = pressed
        self._last_way = _sign(twist.linear) or self._last_way

    def count(self, distance: float, turn: float) -> None:
        """Add a way, in m and rad, to the counters."""
        self._distance += distance
        self._turn += turn

    def target(self, command: c.MotionCommand) -> Twist:
        """Return what a command asks for, in SI."""
        return Twist(command.linear_mmps / 1000, command.angular_raw * self._command_unit)

    def drive(self) -> c.MotionCommand:
        """Return what the motors are told: the command that is held, or BREAK."""
        return BREAK if self.braking() else self.command

    def braking(self) -> bool:
        """Tell whether one of the emergency brakes acts."""
        return (self.ultrasonic_brake and self._near()) or (self.bumper_brake and self._hit())

    def answer(self, frame: Frame) -> Frame | None:
        """Obey a frame and return its answer; a motion command has none."""
        if isinstance(frame, c.MotionCommand):
            self.command = frame
            return None
        if isinstance(frame, c.UltrasonicBrakeSet | c.BumperBrakeSet | c.LedSet):
            return self._set(frame)
        return self._report(frame)

    def velocity(self) -> r.VelocityReport:
        """Return what comes unasked, all the time."""
        return r.VelocityReport(
            round(self._twist.linear * 1000), round(self._twist.angular / self._feedback_unit)
        )

    def driver(self, side: Side) -> r.DriverReport:
        """Return what comes on a query, and unasked on a fault."""
        return r.DriverReport(side, self.driver_bits[side])

    def _set(self, frame: c.UltrasonicBrakeSet | c.BumperBrakeSet | c.LedSet) -> Frame:
        if isinstance(frame, c.UltrasonicBrakeSet):
            self.ultrasonic_brake = frame.on
            return r.UltrasonicBrakeReport(frame.on)
        if isinstance(frame, c.BumperBrakeSet):
            self.bumper_brake = frame.on
            return r.BumperBrakeReport(frame.on)
        known = frame.channel < self._settings.led_channels
        if known:
            self.lamps[frame.channel] = frame
        return r.LedReport(known)

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
            round(math.degrees(wrapped(self._turn)) * 10),
        )

    def _ways(self) -> set[int]:
        """Return where the vehicle moves or is told to: 1 forward, -1 backward."""
        commanded = self.command.linear_mmps if self.command.kind is c.MotionKind.RUN else 0
        return {_sign(self._twist.linear), _sign(commanded / 1000)} - {0}

    def _near(self) -> bool:
        watched = [
            index
            for way, sonars in ((1, FORWARD_SONARS), (-1, BACKWARD_SONARS))
            if way in self._ways()
            for index in sonars
        ]
        return any(self._ranges[index] < self._settings.brake_range * 1000 for index in watched)

    def _hit(self) -> bool:
        backs_off = self._pressed_way != 0 and self._ways() == {-self._pressed_way}
        return self.pressed and not (backs_off and self._settings.bumper_brake == "toward")


def _sign(linear: float) -> int:
    return 0 if abs(linear) < ROLLING else int(math.copysign(1, linear))
