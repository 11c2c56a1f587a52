"""The board's numbers: SI units, plausible values, counters that restarted, the bumper. Pure.

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
# Maximum motion between two samples. A board that was just powered on counts from zero, so the
# limit for a step to zero is much lower, after any time: it is very unlikely to drive to within
# 5 mm of the power-on position while nothing is received.
FAST_MPS, FAST_RADPS, STEP = 5.0, 5.0, 1.0
DRIVEN_MPS, TURNED_RADPS, STEP_TO_ZERO = 1.5, 2.0, 0.02
ZERO_M = 0.005
ZERO_RAD = math.radians(0.5)
GAP_MAX_S = 0.2  # of a gap with a lost link that counts as driving: the board may have been off


class Translator:
    """Converts with the settings of one vehicle."""

    def __init__(self, wire: Wire, vehicle: Vehicle, max_linear: float, max_angular: float) -> None:
        self._commanded_per_radian = PER_RADIAN[wire.command_angular_unit]
        self._measured_per_radian = PER_RADIAN[wire.feedback_angular_unit]
        self._near_mm = vehicle.sonar_min * MM
        self._far_mm = vehicle.sonar_max * MM
        self._max_linear = max_linear
        self._max_angular = max_angular

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


class BumperFilter:
    """Debounces the bumper: one sample is a hit, three consecutive samples are clear.

    The header of a frame has no CRC. Make a new filter after a link loss or a restart of the board.
    """

    CLEAR_SAMPLES = 3

    def __init__(self) -> None:
        self.pressed: bool | None = None  # None until the first hit or three clear samples
        self._clear = 0

    def take(self, pressed: bool) -> bool:
        """Process a sample; return whether a hit begins with it."""
        hit = pressed and not self.pressed
        self._clear = 0 if pressed else self._clear + 1
        if pressed or self._clear >= self.CLEAR_SAMPLES:
            self.pressed = pressed
        return hit


def restarted(
    before: Mileage, after: Mileage, gap_s: float, *, unbroken: bool, silent: bool
) -> bool:
    """Return whether the board's counters jumped, ``gap_s`` after the last sample.

    ``unbroken``: other frames of the board were received throughout, so it may have driven.
    ``silent``: the whole board was silent meanwhile, for some periods of its velocity.
    """
    short_s = min(gap_s, GAP_MAX_S)
    if silent and _from_zero(before, after, short_s):
        return True
    driven_s = gap_s if unbroken else short_s
    distance = abs(after.distance - before.distance)
    turn = abs(math.remainder(after.heading - before.heading, math.tau))
    if abs(after.distance) <= ZERO_M and abs(after.heading) <= ZERO_RAD:
        too_far = distance > STEP_TO_ZERO + DRIVEN_MPS * short_s
        return too_far or turn > STEP_TO_ZERO + TURNED_RADPS * short_s
    return distance > STEP + FAST_MPS * driven_s or turn > STEP + FAST_RADPS * driven_s


# After a short silence of the whole board, which may have been off, a smaller step is enough.
def _from_zero(before: Mileage, after: Mileage, short_s: float) -> bool:
    """Return whether both counters may have restarted at zero, and driving explains one not.

    A vehicle that drives past its power-on position must not count as a restart.
    The emergency brakes are sent after such a silence in any case.
    """
    near = (
        abs(after.distance) <= ZERO_M + DRIVEN_MPS * short_s
        and abs(after.heading) <= ZERO_RAD + TURNED_RADPS * short_s
    )
    nearer = (
        abs(before.distance) - abs(after.distance) > STEP_TO_ZERO + DRIVEN_MPS * short_s
        or abs(before.heading) - abs(after.heading) > STEP_TO_ZERO + TURNED_RADPS * short_s
    )
    return near and nearer
