"""Translation of the board's numbers to SI units, and of motions to frames. Pure.

Only here mm/s and 0.1 deg/s become SI: the bus has metres, radians and seconds, the wire has
millimetres and tenths of a degree (manual 2.2 to 2.7). Implausible values are refused with
``WireError``, because the frame's CRC does not cover everything.
"""

import math

from common.errors import WireError
from common.motion import Twist, clamp
from common.settings import Vehicle, Wire
from common.wire.commands import MotionCommand, MotionKind
from common.wire.frame import MAGNITUDE_MAX
from common.wire.reports import (
    SONAR_FAULT_MM,
    DistanceReport,
    DriverReport,
    UltrasonicReport,
    VelocityReport,
)
from t2.messages import Driver, Mileage, Motion, RangeStatus, Ultrasonic, Velocity

MM = 1000.0
PER_RADIAN = {"decidegree": 1800.0 / math.pi, "milliradian": 1000.0}
# The vehicle cannot exceed these: a larger value means a damaged, unprotected header.
PLAUSIBLE_MPS = 5.0
PLAUSIBLE_RADPS = 10.0

FAULT_NAMES = ("over_current", "over_voltage", "encoder", "under_voltage", "overload")


class Translator:
    """Converts with the settings of one vehicle."""

    def __init__(self, wire: Wire, vehicle: Vehicle) -> None:
        self._commanded_per_radian = PER_RADIAN[wire.command_angular_unit]
        self._measured_per_radian = PER_RADIAN[wire.feedback_angular_unit]
        self._near_mm = vehicle.sonar_min * MM
        self._far_mm = vehicle.sonar_max * MM
        self._max_linear = vehicle.max_linear
        self._max_angular = vehicle.max_angular

    def run(self, motion: Motion) -> MotionCommand:
        """Return the frame of a RUN, slowed on its curve."""
        twist = Twist(motion.linear, motion.angular).within(self._max_linear, self._max_angular)
        angular = clamp(twist.angular * self._commanded_per_radian, MAGNITUDE_MAX)
        return MotionCommand(MotionKind.RUN, round(twist.linear * MM), round(angular))

    def velocity(self, frame: VelocityReport) -> Velocity:
        """Return the measured velocity in m/s and rad/s (manual 2.2)."""
        linear = frame.linear_mmps / MM
        angular = frame.angular_raw / self._measured_per_radian
        if abs(linear) > PLAUSIBLE_MPS or abs(angular) > PLAUSIBLE_RADPS:
            raise WireError(f"implausible velocity {linear:.1f} m/s, {angular:.1f} rad/s")
        return Velocity(linear=linear, angular=angular)

    def mileage(self, frame: DistanceReport, epoch: int) -> Mileage:
        """Return distance in m and heading in rad (manual 2.3)."""
        heading = math.radians(frame.heading_ddeg / 10)
        return Mileage(distance=frame.distance_mm / MM, heading=heading, epoch=epoch)

    def ultrasonic(self, frame: UltrasonicReport) -> Ultrasonic:
        """Return the ranges in m, None if invalid, with their status."""
        ranges = tuple(
            raw_mm / MM if self._status(raw_mm) == "ok" else None for raw_mm in frame.ranges_mm
        )
        return Ultrasonic(
            ranges=ranges, status=tuple(self._status(raw_mm) for raw_mm in frame.ranges_mm)
        )

    def _status(self, raw_mm: int) -> RangeStatus:
        if raw_mm == SONAR_FAULT_MM:
            return "fault"
        if raw_mm < self._near_mm:
            return "too_near"
        return "no_echo" if raw_mm >= self._far_mm else "ok"


def driver(frame: DriverReport) -> Driver:
    """Return the faults of a driver by name, all 32 bits of them (manual 2.7)."""
    names = tuple(
        FAULT_NAMES[bit] if bit < len(FAULT_NAMES) else f"bit_{bit}"
        for bit in range(frame.fault_bits.bit_length())
        if frame.fault_bits >> bit & 1
    )
    return Driver(faults=names, bits=frame.fault_bits)
